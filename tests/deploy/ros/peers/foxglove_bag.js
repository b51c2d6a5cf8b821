// Foxglove's own reader on a bag: decodes every message by the definition in the file. foxglove_bag.js FILE; prints JSON.
const fs = require("fs");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { McapIndexedReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers } = require("@mcap/support");

async function main() {
  const readable = new FileHandleReadable(await fs.promises.open(process.argv[2], "r"));
  const decompressHandlers = await loadDecompressHandlers();
  const file = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const counts = {};
  const readers = new Map();
  for await (const message of file.readMessages()) {
    const channel = file.channelsById.get(message.channelId);
    if (!readers.has(channel.id)) {
      const schema = file.schemasById.get(channel.schemaId);
      readers.set(channel.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
    }
    readers.get(channel.id).readMessage(message.data);
    counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
  }
  console.log(JSON.stringify(counts));
}

main();
