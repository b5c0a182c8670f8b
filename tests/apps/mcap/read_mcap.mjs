// Reads an MCAP file with the readers that Foxglove uses: by its index, as a stream, and as a stream that was cut.
// Usage: node read_mcap.mjs FILE    Prints one JSON object.
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import * as zstd from "@foxglove/wasm-zstd";
import { readFile } from "node:fs/promises";

await zstd.isLoaded;
const decompressHandlers = { zstd: (bytes, size) => zstd.decompress(bytes, Number(size)) };
const bytes = new Uint8Array(await readFile(process.argv[2]));

function countStreamed(part) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(part);
  let count = 0;
  for (let record; (record = reader.nextRecord()); ) count += record.type === "Message" ? 1 : 0;
  return { count, isDone: reader.done() };
}

const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => bytes.slice(Number(offset), Number(offset + size)),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const decoders = new Map();
const topics = {};
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  if (!decoders.has(schema.id)) {
    decoders.set(schema.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  const value = decoders.get(schema.id).readMessage(message.data);
  const topic = (topics[channel.topic] ??= { type: schema.name, encoding: channel.messageEncoding, messages: [] });
  if (value.data?.length !== undefined) {
    const counts = {};
    for (const cell of value.data) counts[cell] = (counts[cell] ?? 0) + 1;
    value.data = counts;
  }
  topic.messages.push({ time: message.logTime, value });
}
const metadata = {};
for await (const record of reader.readMetadata()) metadata[record.name] = Object.fromEntries(record.metadata);
const result = {
  profile: reader.header.profile,
  messageCount: reader.statistics.messageCount,
  metadata,
  topics,
  streamed: countStreamed(bytes),
  cut: countStreamed(bytes.subarray(0, Math.floor(bytes.length * 0.6))),
};
console.log(JSON.stringify(result, (key, value) => (typeof value === "bigint" ? String(value) : value)));
