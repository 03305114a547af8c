import * as errors from "./errors.js";
import { Node } from "./node.js";
import { client, masterRegister, publisher, subscriber } from "./original_api.js";

export * from "./errors.js";
export { Node, Node as node } from "./node.js";
export type { Configuration, DirectConfiguration, DirectOptions, HybridConfiguration, OriginalConfiguration } from "./configuration.js";
export type { NodeOptions, PayloadCallback } from "./node.js";
export { client, masterRegister, publisher, subscriber } from "./original_api.js";
export type { OriginalRegistration, Requester } from "./original_api.js";
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

export default { ...errors, Node, node: Node, client, masterRegister, publisher, subscriber };
