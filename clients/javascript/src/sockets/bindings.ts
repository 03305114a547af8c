import { NepError } from "../errors.js";
import { isFreePort } from "../system/addresses.js";

const BIND_TRIES = 100;

interface Bindable {
  bind(endpoint: string): Promise<string>;
  unbind(endpoint: string): Promise<void>;
}

/** Addresses at which a socket is bound, each with its own port; avoids the ports of the original NEP. */
export class Bindings {
  private readonly bound = new Map<string, string>();
  private moving: Promise<unknown> = Promise.resolve();

  constructor(private readonly socket: Bindable) {}

  /** Bind at exactly these hosts. Resolves to the endpoints in the order of the hosts. */
  move(hosts: readonly string[]): Promise<string[]> {
    const moved = this.moving.then(() => this.bindAt(hosts)); // sequentially
    this.moving = moved.catch(() => undefined);
    return moved;
  }

  private async bindAt(hosts: readonly string[]): Promise<string[]> {
    for (const [host, endpoint] of this.bound) {
      if (hosts.includes(host)) continue;
      this.bound.delete(host);
      await this.socket.unbind(endpoint);
    }
    for (const host of hosts) if (!this.bound.has(host)) this.bound.set(host, await this.bindFreePort(host));
    return hosts.map((host) => this.bound.get(host)!);
  }

  private async bindFreePort(host: string): Promise<string> {
    for (let tries = 0; tries < BIND_TRIES; tries++) {
      const endpoint = await this.socket.bind(`tcp://${host}:*`);
      if (isFreePort(Number(endpoint.slice(endpoint.lastIndexOf(":") + 1)))) return endpoint;
      await this.socket.unbind(endpoint);
    }
    throw new NepError(`No free port was found at ${host}.`);
  }
}
