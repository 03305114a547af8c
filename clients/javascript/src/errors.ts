/** Base class of all errors that this package raises. */
export class NepError extends Error {
  override get name(): string {
    return this.constructor.name;
  }
}

/** A topic name that the wire does not allow. */
export class BadTopicError extends NepError {}

/** A node name that the wire does not allow. */
export class BadNameError extends NepError {}

/** The codes of {@link WireError}; the vectors in `tests/data/wire` use the same ones. */
export type WireErrorCode = string;

/** Bytes that are not a message, a notice or a reply of the native wire. */
export class WireError extends NepError {
  /** @param code Stable, machine-readable reason. */
  constructor(
    readonly code: WireErrorCode,
    message: string,
  ) {
    super(message);
  }
}

/** A payload that can't be encoded by the codec of its topic. */
export class EncodeError extends NepError {}

/** A payload that can't be decoded by the codec of its message. */
export class DecodeError extends NepError {}

/** No master answered in time. */
export class MasterUnreachableError extends NepError {
  /** @param address Host and port of the master. */
  constructor(readonly address: string) {
    super(`No master answers at ${address}. Start one with "nep master", or set NEP_MASTER to its address.`);
  }
}

/** The master or a server did not carry out a request; the message says why. */
export class RequestRefusedError extends NepError {}

/** The node, publisher, subscriber, client or server is closed. */
export class ClosedError extends NepError {}

/** No server of the service was reached in time; nothing was sent. */
export class NoServerError extends NepError {}

/** The call was sent and no answer came in time; the server may still carry it out. */
export class ServiceTimeoutError extends NepError {}

/** The server ended while the call was under way; it may or may not have been carried out. */
export class ServerGoneError extends NepError {}

/** The server's callback raised an error. */
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
