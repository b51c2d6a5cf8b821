// Foxglove's own client on a live server: subscribes to all channels, decodes every message, and presses a button as
// soon as it has heard the wanted topics and frames. foxglove_live.js URL SERVICE '{"topics": [], "frames": []}' prints
// JSON when the button is answered, or what there is after a minute. The libraries are found through NODE_PATH.
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");

const PATIENCE_MS = 60000;
const [url, service, wanted] = process.argv.slice(2);
const { topics, frames } = JSON.parse(wanted);
const client = new FoxgloveClient({ ws: new WebSocket(url, ["foxglove.sdk.v1"]) });
const channels = new Map();
const heard = {};
const placed = new Set();
const services = {};

client.on("advertise", (advertised) => {
  for (const one of advertised) {
    const reader = new MessageReader(parse(one.schema, { ros2: true }));
    channels.set(client.subscribe(one.id), { topic: one.topic, reader });
  }
});
client.on("message", ({ subscriptionId, data }) => {
  const { topic, reader } = channels.get(subscriptionId);
  const message = reader.readMessage(data);
  if (topic === "/tf") {
    message.transforms.forEach((one) => placed.add(one.child_frame_id)); // of the robots with news
  }
  heard[topic] = (heard[topic] ?? 0) + 1;
});
client.on("advertiseServices", (offered) => {
  for (const one of offered) {
    services[one.name] = one;
  }
});
client.on("serviceCallResponse", ({ data }) => {
  finish(new MessageReader(parse("bool success\nstring message", { ros2: true })).readMessage(data));
});
const asking = setInterval(() => {
  const complete = topics.every((one) => one in heard) && frames.every((one) => placed.has(one));
  if (!complete || services[service] === undefined) {
    return;
  }
  clearInterval(asking);
  const writer = new MessageWriter(parse("uint8 structure_needs_at_least_one_member", { ros2: true }));
  const data = new DataView(writer.writeMessage({ structure_needs_at_least_one_member: 0 }).buffer);
  client.sendServiceCallRequest({ serviceId: services[service].id, callId: 1, encoding: "cdr", data });
}, 100);
setTimeout(() => finish(null), PATIENCE_MS);

function finish(called) {
  console.log(JSON.stringify({ heard, frames: [...placed], services: Object.keys(services), called }));
  process.exit(0);
}
