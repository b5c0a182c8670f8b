// Reads moondb_view with two clients of Foxglove's WebSocket protocol: that of @foxglove/ws-protocol, which offers
// foxglove.websocket.v1, and a plain one that offers foxglove.sdk.v1 alone. Each subscribes to all channels and decodes
// their messages by the schemas that the server sent. Prints a line for each; ends with 1 and the reason if one is wrong.
//
// Usage: foxglove_checks.mjs URL PROGRAMS LAYOUT    URL begins with http://; LAYOUT is configs/foxglove_layout.json.
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import protocol from "@foxglove/ws-protocol";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";
import { WebSocket } from "ws";

const [url, programs, layoutFile] = process.argv.slice(2);
const kWait_ms = 120_000;
const address = url.replace("http://", "ws://");

function require(condition, text) {
  if (!condition) throw new Error(text);
}

function layoutTopics() {
  const panels = JSON.parse(readFileSync(layoutFile)).configById;
  return [...Object.keys(panels["3D!map"].topics), panels["RosOut!events"].topicToRender, panels["RawMessages!team"].topicPath];
}

// Returns a function that decodes the messages of a channel.
function decoderOf(channel) {
  if (channel.encoding === "json") return (bytes) => JSON.parse(Buffer.from(bytes).toString());
  require(channel.encoding === "protobuf" && channel.schemaEncoding === "protobuf", `${channel.topic}: ${channel.encoding}`);
  const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(Buffer.from(channel.schema, "base64")));
  const type = root.lookupType(channel.schemaName);
  return (bytes) => type.toObject(type.decode(bytes), { defaults: true, enums: String, bytes: Buffer });
}

// Collects the newest message of each topic, until all topics have one and the map is whole.
class Collector {
  constructor(name, expected) {
    Object.assign(this, { name, expected, topics: new Map(), newest: new Map(), decoders: new Map() });
    this.done = new Promise((resolve, reject) => { this.resolve = resolve; this.reject = reject; });
    setTimeout(() => this.reject(new Error(`${name}: ${JSON.stringify(this.cells())} of ${JSON.stringify(expected)}, topics ` +
      `${[...this.topics.values()].filter((topic) => !this.newest.has(topic))} are silent`)), kWait_ms).unref();
  }

  add(subscription, channel) {
    this.topics.set(subscription, channel.topic);
    this.decoders.set(subscription, decoderOf(channel));
  }

  take(subscription, bytes) {
    this.newest.set(this.topics.get(subscription), this.decoders.get(subscription)(bytes));
    if ([...this.topics.values()].some((topic) => !this.newest.has(topic))) return;
    const { free, hazard } = this.cells();
    if (free === this.expected.free && hazard === this.expected.hazard) this.resolve();
  }

  cells() {
    const counts = [0, 0, 0];
    for (const [topic, grid] of this.newest) {
      if (topic.startsWith("/map/")) grid.data.forEach((value) => { ++counts[value]; });
    }
    return { free: counts[1], hazard: counts[2] };
  }

  check() {
    const frames = this.newest.get("/tf").transforms;
    for (const rover of ["rover1", "rover2", "rover3"]) {
      const frame = frames.find(({ child_frame_id: child }) => child === rover);
      require(frame?.parent_frame_id === "map", `${this.name}: no transform of ${rover}`);
    }
    require(this.newest.get("/moondb/team").answers.leader.text.includes("leads"), `${this.name}: no leader`);
    require(this.newest.get("/graph").entities.some(({ id }) => id === "track rover1"), `${this.name}: no track of rover1`);
    require(this.newest.get("/events").level === "INFO", `${this.name}: an event of level ${this.newest.get("/events").level}`);
    const offered = new Set(this.topics.values());
    const missing = layoutTopics().filter((topic) => !offered.has(topic) && !/^\/map\/-?\d+_-?\d+$/.test(topic));
    require(missing.length === 0, `${layoutFile} names the topics ${missing}, which the server does not have`);
    console.log(`${this.name}: ${this.topics.size} channels, ${JSON.stringify(this.cells())} cells`);
  }
}

async function useFoxgloveClient(expected) {
  const collector = new Collector("foxglove.websocket.v1", expected);
  const { FoxgloveClient } = protocol;
  const socket = new WebSocket(address, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
  const client = new FoxgloveClient({ ws: socket });
  client.on("error", (error) => collector.reject(error));
  client.on("status", ({ message }) => collector.reject(new Error(message)));
  client.on("advertise", (channels) => channels.forEach((channel) => collector.add(client.subscribe(channel.id), channel)));
  client.on("message", ({ subscriptionId, data }) => {
    collector.take(subscriptionId, new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  });
  await collector.done;
  collector.check();
  client.close();
}

async function usePlainSocket(expected) {
  const collector = new Collector("foxglove.sdk.v1", expected);
  const socket = new WebSocket(address, ["foxglove.sdk.v1"]);
  socket.on("error", (error) => collector.reject(error));
  socket.on("message", (data, isBinary) => {
    if (isBinary) {
      require(data.readUInt8(0) === 1, `opcode ${data.readUInt8(0)}`);
      require(data.readBigUInt64LE(5) > 0n, "a message has no time");
      return collector.take(data.readUInt32LE(1), data.subarray(13));
    }
    const message = JSON.parse(data.toString());
    if (message.op === "status") return collector.reject(new Error(message.message));
    if (message.op !== "advertise") return undefined;
    const subscriptions = message.channels.map((channel) => ({ id: 1000 + channel.id, channelId: channel.id }));
    message.channels.forEach((channel) => collector.add(1000 + channel.id, channel));
    return socket.send(JSON.stringify({ op: "subscribe", subscriptions }));
  });
  await collector.done;
  require(socket.protocol === "foxglove.sdk.v1", `the server chose ${socket.protocol}`);
  collector.check();
  socket.close();
}

async function useWrongProtocol() {
  const socket = new WebSocket(address, ["chat"]);
  const status = await new Promise((resolve) => { socket.on("unexpected-response", (_, { statusCode }) => resolve(statusCode)); });
  require(status === 400, `another subprotocol: status ${status}`);
}

async function main() {
  const stats = JSON.parse(execFileSync(`${programs}/moonctl`, ["-a", "rover1", "--json", "map", "stats"], { encoding: "utf8" }));
  const expected = { free: Number(stats.free_cell_count), hazard: Number(stats.hazard_cell_count) };
  await useFoxgloveClient(expected);
  await usePlainSocket(expected);
  await useWrongProtocol();
}

main().then(() => process.exit(0), (error) => { console.error(String(error.message ?? error)); process.exit(1); });
