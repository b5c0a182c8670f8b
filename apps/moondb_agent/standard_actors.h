// The standard actors of an agent. All programs that run whole agents (moondb_agent, the simulator, the tests of whole
// teams) use this list, so none can omit an actor.
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
#include "actors/registration/register_actor.h"
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

// Options that differ between the programs that start the actors. StandardActors adds `self`, `team` and the team
// file's settings for each actor.
struct StandardActorOptions {
  StorageActor::Options storage;
  ClockActor::Options clock;
  RoleActor::Options role;
  LeaseActor::Options lease;
  FailoverActor::Options failover;
  SharingActor::Options sharing;  // Used by the actors sync and replica.
  RetentionActor::Options retention;
  EventActor::Options event;
  DownlinkActor::Options downlink;
  PgoActor::Options pgo;
  RegisterActor::Options registration;
  MergeActor::Options merge;
  GatewayActor::Options gateway;
};

// Returns the actors in the order in which they start. `config_hash` is TeamFile::hash.
std::vector<StandardActor> StandardActors(const proto::TeamConfig& team, AgentId self, std::uint64_t config_hash,
                                          StandardActorOptions options);

}  // namespace moondb
