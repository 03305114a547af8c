import * as errors from "./errors.js";
import { Node } from "./node.js";

export * from "./errors.js";
export { Node, Node as node } from "./node.js";
export type { Configuration, DirectConfiguration, DirectOptions, HybridConfiguration } from "./configuration.js";
export type { NodeOptions, PayloadCallback } from "./node.js";
export type { Image } from "./messages/image.js";
export { Message } from "./messages/message.js";
export { Publisher } from "./pubsub/publisher.js";
export type { PublisherOptions } from "./pubsub/publisher.js";
export { Subscriber } from "./pubsub/subscriber.js";
export type { MessageCallback, SubscribeOptions } from "./pubsub/subscriber.js";
export { Client } from "./services/client.js";
export type { CallOptions, ClientOptions } from "./services/client.js";
export { Server } from "./services/server.js";
export type { ServiceCallback } from "./services/server.js";

export default { ...errors, Node, node: Node };
