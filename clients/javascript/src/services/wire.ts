/** Wire format of services: encoding of calls and replies. Specified in docs/services.md. */
import { BadTopicError, WireError } from "../errors.js";
import { checkTopic } from "../wire/names.js";

export const SERVICE_PREFIX = "nep.service:";
const SURVEY_PREFIX = "survey:";
/** Type and codec under which servers and clients are registered. */
export const SERVICE_TYPE = "service";
/** Maximum size of a call or reply; peers that send more are disconnected. */
export const MAX_PAYLOAD_BYTES = 64 * 2 ** 20;

const VERSION = 1;
const HEADER_BYTES = 16;
const MAX_TIMEOUT_MS = 2 ** 32 - 1;
const MAX_REASON_LETTERS = 2000;

/** Kinds of calls and replies. */
export const CallKind = { CALL: 1, ANSWER: 2, ERROR: 3, REFUSED: 4 } as const;

export interface CallParts {
  readonly kind: number;
  readonly codec: number;
  /** Timeout of the client in milliseconds; 0 for none, and in replies. */
  readonly timeoutMs: number;
  readonly number: bigint;
  readonly payload: Buffer;
}

/** Return the parts of a call or reply. */
export function packCall(call: CallParts): Buffer[] {
  const header = Buffer.alloc(HEADER_BYTES);
  header[0] = VERSION;
  header[1] = call.kind;
  header.writeUInt16LE(call.codec, 2);
  header.writeUInt32LE(call.timeoutMs, 4);
  header.writeBigUInt64LE(call.number, 8);
  return [header, call.payload];
}

/** Return the timeout field of a call: milliseconds, at least 1; 0 means no limit. */
export function timeoutMs(timeoutS: number | null): number {
  return timeoutS === null ? 0 : Math.max(1, Math.min(MAX_TIMEOUT_MS, Math.round(timeoutS * 1000)));
}

/** Read a call (`call`) or a reply (`answer`). @throws {WireError} `call-parts`, `call-version` or `call-kind` */
export function readCall(parts: readonly Buffer[], expected: "call" | "answer"): CallParts {
  const [header, payload] = parts;
  if (parts.length !== 2 || header!.length !== HEADER_BYTES || !payload) {
    throw new WireError("call-parts", `A call has two parts, the first of ${HEADER_BYTES} bytes.`);
  }
  const version = header![0];
  if (version !== VERSION) {
    throw new WireError(
      "call-version",
      `The call has version ${version} of the services wire, which this nep-js doesn't support. Update nep-js.`,
    );
  }
  const kind = header![1]!;
  const isRight = expected === "call" ? kind === CallKind.CALL : kind >= CallKind.ANSWER && kind <= CallKind.REFUSED;
  if (!isRight) throw new WireError("call-kind", `Kind ${kind} is not a valid ${expected} of a service.`);
  return {
    kind,
    codec: header!.readUInt16LE(2),
    timeoutMs: header!.readUInt32LE(4),
    number: header!.readBigUInt64LE(8),
    payload,
  };
}

/** Return the payload of an error or rejection. `kind` is the class of the error, empty for a rejection. */
export function packFailure(kind: string, reason: string): Buffer {
  return Buffer.from(JSON.stringify({ nep_error: kind.slice(0, 100), reason: reason.slice(0, MAX_REASON_LETTERS) }));
}

/** Read the payload of an error or rejection. Accepts any bytes. */
export function readFailure(payload: Buffer): { kind: string; reason: string } {
  let said: unknown;
  try {
    said = JSON.parse(payload.toString("utf8"));
  } catch {
    said = undefined;
  }
  if (said === null || typeof said !== "object") return { kind: "", reason: "the reason can't be read" };
  const { nep_error: kind = "", reason = "" } = said as Record<string, unknown>;
  return { kind: String(kind).slice(0, 100), reason: String(reason).slice(0, MAX_REASON_LETTERS) };
}

/** Return the topic under which servers and clients of a service are registered. @throws {BadTopicError} */
export function topicOfService(service: string): string {
  checkTopic(service);
  if (service.startsWith(SERVICE_PREFIX) || service.startsWith(SURVEY_PREFIX)) {
    throw new BadTopicError(
      `"${service}" is not a valid service name: the prefixes "${SERVICE_PREFIX}" and "${SURVEY_PREFIX}" are reserved.`,
    );
  }
  return checkTopic(SERVICE_PREFIX + service);
}
