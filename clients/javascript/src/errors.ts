/** Base class of all errors thrown by this package. */
export class NepError extends Error {
  override get name(): string {
    return this.constructor.name;
  }
}

/** The topic name is invalid. */
export class BadTopicError extends NepError {}

/** The node name is invalid. */
export class BadNameError extends NepError {}

/** Code of a {@link WireError}; the vectors in `tests/data/wire` use the same codes. */
export type WireErrorCode = string;

/** Malformed message, notice or reply of the native wire. */
export class WireError extends NepError {
  /** @param code Stable, machine-readable reason. */
  constructor(
    readonly code: WireErrorCode,
    message: string,
  ) {
    super(message);
  }
}

/** The payload can't be encoded by the codec of its topic. */
export class EncodeError extends NepError {}

/** The payload can't be decoded by the codec of its message. */
export class DecodeError extends NepError {}

/** No master replied before the timeout. */
export class MasterUnreachableError extends NepError {
  /** @param address Host and port of the master. */
  constructor(readonly address: string) {
    super(`No master is reachable at ${address}. Start one with "nep master", or set NEP_MASTER to its address.`);
  }
}

/** The master or a server rejected a request; the message gives the reason. */
export class RequestRefusedError extends NepError {}

/** The node, publisher, subscriber, client or server is closed. */
export class ClosedError extends NepError {}

/** No server of the service was reached before the timeout; nothing was sent. */
export class NoServerError extends NepError {}

/** The call was sent, but no reply arrived before the timeout; the server may still execute it. */
export class ServiceTimeoutError extends NepError {}

/** The server exited during the call, which may or may not have been executed. */
export class ServerGoneError extends NepError {}

/** The callback of the server threw an error. */
export class ServiceError extends NepError {
  /**
   * @param kind Class name of the error at the server.
   * @param reason Message of the error at the server.
   */
  constructor(
    readonly kind: string,
    readonly reason: string,
  ) {
    super(kind ? `${kind}: ${reason}` : reason);
  }
}
