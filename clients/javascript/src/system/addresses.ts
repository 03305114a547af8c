import { createSocket } from "node:dgram";
import { NepError } from "../errors.js";

export const LOOPBACK = "127.0.0.1";
const DEFAULT_PORT = 7780;
const HOST = /^[\w.-]+$/;
const ENDPOINT = /^tcp:\/\/[\w.-]{1,253}:(\d{1,5})$/;
/** Ports of the original NEP, which publishers must not use. */
const ORIGINAL_PORTS = new Set([7000, 7777, 7780, 12345, 50000]);

/**
 * Return host and port of the master: `address`, else `NEP_MASTER`, else `127.0.0.1:7780`. The port is optional.
 *
 * @throws {NepError} if the address is invalid.
 */
export function masterAddress(address?: string): string {
  const chosen = (address || process.env["NEP_MASTER"] || `${LOOPBACK}:${DEFAULT_PORT}`).replace(/^tcp:\/\//, "");
  const [host, port = String(DEFAULT_PORT), ...more] = chosen.split(":");
  if (!host || !HOST.test(host) || !isPort(Number(port)) || more.length > 0) {
    throw new NepError(`Invalid master address "${chosen}". Use the form ${LOOPBACK}:${DEFAULT_PORT}.`);
  }
  return `${host}:${port}`;
}

export function hostOf(address: string): string {
  return address.slice(0, address.lastIndexOf(":"));
}

export function isLoopback(address: string): boolean {
  const host = hostOf(address);
  return host === "localhost" || /^127\.\d+\.\d+\.\d+$/.test(host);
}

/** Return true if publishers may use this port, which is not one of the original NEP's. */
export function isFreePort(port: number): boolean {
  return !ORIGINAL_PORTS.has(port) && !(port >= 9000 && port <= 9999);
}

function isPort(port: number): boolean {
  return Number.isInteger(port) && port > 0 && port < 65536;
}

/**
 * Return the endpoint of a publisher that this node can reach, or undefined. On the master's computer this is the
 * loopback endpoint; elsewhere the first other one, with `0.0.0.0` replaced by the master's host.
 */
export function nearestEndpoint(endpoints: readonly string[], master: string): string | undefined {
  const usable = endpoints.filter((each) => {
    const match = ENDPOINT.exec(each);
    return match && isPort(Number(match[1]));
  });
  const isLocal = (endpoint: string): boolean => isLoopback(endpoint.slice("tcp://".length));
  const chosen = isLoopback(master) ? (usable.find(isLocal) ?? usable[0]) : usable.find((each) => !isLocal(each));
  return chosen?.replace("tcp://0.0.0.0:", `tcp://${hostOf(master)}:`);
}

/** Return this computer's address on the route to `address`; the loopback address if there is no route. */
export function hostTowards(address: string): Promise<string> {
  return new Promise((resolve) => {
    const socket = createSocket("udp4");
    const finish = (host: string): void => {
      socket.close();
      resolve(host);
    };
    socket.once("error", () => finish(LOOPBACK));
    socket.connect(Number(address.slice(address.lastIndexOf(":") + 1)), hostOf(address), () =>
      finish(socket.address().address),
    );
  });
}
