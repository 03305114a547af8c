import { NepError } from "./errors.js";
import type { Generation } from "./pubsub/original.js";

const MODES = ["one2many", "many2one", "many2many"] as const;

/** Neither side binds; the default mode of nep-js 0.1.1. */
type Mode = (typeof MODES)[number] | "connect";

/** Connection through a master; returned by `Node.hybrid`. */
export interface HybridConfiguration {
  readonly kind: "hybrid";
  readonly master: string;
}

/** Connection to one address without a master; returned by `Node.direct`. */
export interface DirectConfiguration {
  readonly kind: "direct";
  readonly ip: string;
  readonly port: number;
  readonly mode: Mode;
  readonly generation: Generation;
  readonly wire: "original" | "native";
}

/** Configuration object of programs for nep-js 0.1.1 that don't call `direct`, `master` or `hybrid`. */
export interface OriginalConfiguration {
  readonly network: string;
  readonly transport?: string;
  readonly mode?: string;
  readonly ip?: string;
  readonly port?: number | string;
  readonly master_ip?: string;
}

/** Configuration of how a publisher or subscriber connects. */
export type Configuration = HybridConfiguration | DirectConfiguration;

/** Wire options of a direct connection. */
export interface DirectOptions {
  /**
   * Generation of the frames sent: `A` (default) for the original NEP up to 0.5.4.5, `B` from 0.5.4.8 on.
   * Both are received.
   */
  readonly generation?: Generation;
  /** Wire: `original` (default) or `native`. */
  readonly wire?: "original" | "native";
}

/** Return a direct configuration. @throws {NepError} if the address, port or mode is invalid. */
export function directConfiguration(
  ip: string,
  port: number | string,
  mode: string | undefined,
  options: DirectOptions,
): DirectConfiguration {
  const known = mode === undefined ? "connect" : MODES.find((each) => each === mode);
  if (!known) throw new NepError(`Invalid mode "${mode}". Use ${MODES.join(", ")}.`);
  const number = Number(port);
  if (!Number.isInteger(number) || number < 1 || number > 65535)
    throw new NepError(`Invalid port "${port}". Use a number from 1 to 65535.`);
  if (!/^[\w.-]+$/.test(ip)) throw new NepError(`Invalid address "${ip}".`);
  return {
    kind: "direct",
    ip,
    port: number,
    mode: known,
    generation: options.generation ?? "A",
    wire: options.wire ?? "original",
  };
}

/**
 * Return the endpoint of one side of a direct connection and whether it binds or connects.
 * In `many2many`, a proxy of the original NEP binds both ports.
 */
export function attachment(
  direct: DirectConfiguration,
  isPublisher: boolean,
): { endpoint: string; how: "bind" | "connect" } {
  if (direct.mode === "many2many") {
    return { endpoint: `tcp://${direct.ip}:${direct.port + (isPublisher ? 0 : 1)}`, how: "connect" };
  }
  const binds = direct.mode !== "connect" && isPublisher === (direct.mode === "one2many");
  return { endpoint: `tcp://${direct.ip}:${direct.port}`, how: binds ? "bind" : "connect" };
}
