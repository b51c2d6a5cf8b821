// Foxglove's own client on a live server: subscribes to all channels, decodes every message, presses a button.
// foxglove_live.js URL MILLISECONDS SERVICE; prints JSON. The libraries are found through NODE_PATH.
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");

const [url, wait, service] = process.argv.slice(2);
const client = new FoxgloveClient({ ws: new WebSocket(url, ["foxglove.sdk.v1"]) });
const channels = new Map();
const heard = {};
const last = {};
const services = {};
let called = null;

client.on("advertise", (advertised) => {
  for (const one of advertised) {
    const reader = new MessageReader(parse(one.schema, { ros2: true }));
    channels.set(client.subscribe(one.id), { topic: one.topic, reader });
  }
});
client.on("message", ({ subscriptionId, data }) => {
  const { topic, reader } = channels.get(subscriptionId);
  last[topic] = reader.readMessage(data);
  heard[topic] = (heard[topic] ?? 0) + 1;
});
client.on("advertiseServices", (offered) => {
  for (const one of offered) {
    services[one.name] = one;
  }
});
client.on("serviceCallResponse", ({ data }) => {
  called = new MessageReader(parse("bool success\nstring message", { ros2: true })).readMessage(data);
});
setTimeout(() => {
  if (services[service] !== undefined) {
    const writer = new MessageWriter(parse("uint8 structure_needs_at_least_one_member", { ros2: true }));
    const data = new DataView(writer.writeMessage({ structure_needs_at_least_one_member: 0 }).buffer);
    client.sendServiceCallRequest({ serviceId: services[service].id, callId: 1, encoding: "cdr", data });
  }
}, Number(wait));
setTimeout(() => {
  const big = (_, value) => (typeof value === "bigint" ? Number(value) : value);
  const frames = (last["/tf"]?.transforms ?? []).map((one) => one.child_frame_id);
  console.log(JSON.stringify({ heard, frames, services: Object.keys(services), called }, big));
  process.exit(0);
}, Number(wait) + 9000);
