import { ClosedError, MasterUnreachableError, NepError, RequestRefusedError, WireError } from "../errors.js";
import { type Answer, decodeAnswer, encodeRequest, type Request } from "../protocol/requests.js";
import { DealerSocket } from "../sockets/socket.js";

interface PendingCall {
  readonly request: Request;
  readonly timer: NodeJS.Timeout | undefined;
  readonly onReply: ((answer: Answer) => void) | undefined;
  readonly resolve: (answer: Answer) => void;
  readonly reject: (error: NepError) => void;
}

/**
 * Requests to the master over one DEALER socket. A silent connection is replaced by a new one, over which pending calls
 * are sent again, so that nothing is queued while there is no master.
 */
export class RpcClient {
  /** Time of the last message from the master, by `performance.now()`. */
  heardAt = -Infinity;
  private nextCall = 1;
  private readonly pending = new Map<number, PendingCall>();
  private socket: DealerSocket;
  private isClosed = false;

  constructor(
    readonly address: string,
    private readonly onAnswer: (answer: Answer, call: number) => void,
    private readonly onRefused: (error: WireError) => void,
    private readonly isHeld: () => boolean,
  ) {
    this.socket = this.connect();
  }

  private connect(): DealerSocket {
    return new DealerSocket(
      `tcp://${this.address}`,
      (parts) => this.read(parts),
      () => (this.pending.size > 0 ? "brief" : this.isHeld() ? "long" : "none"),
    );
  }

  /** Replace the connection and resend pending calls. */
  reconnect(): void {
    if (this.isClosed) return;
    this.socket.close();
    this.socket = this.connect();
    this.resend();
  }

  /** Resend pending calls; the master accepts repeated requests. */
  resend(): void {
    for (const [call, each] of this.pending) this.socket.send([encodeRequest(each.request, call)]);
  }

  /** Send a request whose reply is passed only to `onAnswer`. Return the number of the call. */
  tell(request: Request): number {
    const call = this.nextCall++;
    if (!this.isClosed) this.socket.send([encodeRequest(request, call)]);
    return call;
  }

  /**
   * Send a request and return its reply.
   *
   * @param timeoutS Seconds; undefined waits without a time limit.
   * @param onReply Called with the reply before any later message of the master is handled.
   * @throws {MasterUnreachableError} if no reply arrived before the timeout.
   * @throws {RequestRefusedError} if the master rejected the request.
   */
  ask(request: Request, timeoutS?: number, onReply?: (answer: Answer) => void): Promise<Answer> {
    if (this.isClosed) return Promise.reject(new ClosedError("The node is closed."));
    return new Promise<Answer>((resolve, reject) => {
      const call = this.nextCall++;
      const expire = (): void => {
        this.pending.delete(call);
        reject(new MasterUnreachableError(this.address));
      };
      const timer = timeoutS === undefined ? undefined : setTimeout(expire, timeoutS * 1000);
      this.pending.set(call, { request, timer, onReply, resolve, reject });
      this.socket.send([encodeRequest(request, call)]);
    });
  }

  wake(): void {
    this.socket.wake();
  }

  close(): void {
    this.isClosed = true;
    this.socket.close();
    for (const each of this.pending.values()) {
      clearTimeout(each.timer);
      each.reject(new ClosedError("The node is closed."));
    }
    this.pending.clear();
  }

  private read(parts: Buffer[]): void {
    let read: { call: number; answer: Answer };
    try {
      if (parts.length !== 1) throw new WireError("part-count", `A reply has one part, this one has ${parts.length}.`);
      read = decodeAnswer(parts[0]!);
    } catch (error) {
      if (!(error instanceof WireError)) throw error;
      this.onRefused(error);
      return;
    }
    this.heardAt = performance.now();
    this.onAnswer(read.answer, read.call);
    const pending = this.pending.get(read.call);
    if (!pending) return;
    this.pending.delete(read.call);
    clearTimeout(pending.timer);
    pending.onReply?.(read.answer);
    if (read.answer.is === "refused") pending.reject(new RequestRefusedError(read.answer.reason));
    else pending.resolve(read.answer);
  }
}
