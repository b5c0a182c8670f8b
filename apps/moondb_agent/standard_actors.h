// The actors that every agent has, and how they are put together: one row for each in standard_actors.cc.
//
// moondb_agent, the simulator and the tests of whole teams spawn from this list, so that none forgets an actor; one
// that is left out is left out by name.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "actors/clock/clock_actor.h"
#include "actors/event/event_actor.h"
#include "actors/gateway/gateway_actor.h"
#include "actors/lease/lease_actor.h"
#include "actors/merge/merge_actor.h"
#include "actors/pgo/pgo_actor.h"
#include "actors/retention/retention_actor.h"
#include "actors/role/failover_actor.h"
#include "actors/role/role_actor.h"
#include "actors/sharing/downlink_actor.h"
#include "actors/sharing/replica_actor.h"
#include "actors/sharing/sync_actor.h"
#include "actors/storage/storage_actor.h"
#include "runtime/actor.h"

namespace moondb {

struct StandardActor {
  std::string name;
  Placement placement = Placement::kPool;
  ActorFactory factory;
};

// What differs from one program to another. StandardActors fills in `self` and `team` of each, and what the team file
// says of it.
struct StandardActorOptions {
  StorageActor::Options storage;
  ClockActor::Options clock;
  RoleActor::Options role;
  LeaseActor::Options lease;
  FailoverActor::Options failover;
  SharingActor::Options sharing;  // Of sync and replica.
  RetentionActor::Options retention;
  EventActor::Options event;
  DownlinkActor::Options downlink;
  PgoActor::Options pgo;
  MergeActor::Options merge;
  GatewayActor::Options gateway;
};

// In the order in which they are to start. `config_hash` is TeamFile::hash.
std::vector<StandardActor> StandardActors(const proto::TeamConfig& team, AgentId self, std::uint64_t config_hash,
                                          StandardActorOptions options);

}  // namespace moondb
