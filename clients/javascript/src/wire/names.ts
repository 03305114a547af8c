import { BadNameError, BadTopicError } from "../errors.js";

const MAX_NAME_BYTES = 200;
const CONTROL =
  /[\u0000-\u001F\u007F-\u009F\u061C\u200B\u200E\u200F\u2028-\u202E\u2060-\u206F\uFEFF\uFFF9-\uFFFB]|[\uD800-\uDBFF](?![\uDC00-\uDFFF])|(?<![\uD800-\uDBFF])[\uDC00-\uDFFF]/;
const NOT_IN_TOPIC = /[\s\u001C-\u001F\u0085{]/;

function hasAllowedSize(name: string): boolean {
  const size = Buffer.byteLength(name, "utf8");
  return size >= 1 && size <= MAX_NAME_BYTES;
}

/**
 * Return `topic` if it is valid: 1 to 200 bytes of UTF-8 without white space, control characters and `{`.
 *
 * @throws {BadTopicError} if it is invalid; the message contains the reason.
 */
export function checkTopic(topic: string): string {
  if (typeof topic !== "string") throw new BadTopicError("A topic must be a string.");
  if (!hasAllowedSize(topic)) {
    throw new BadTopicError(`Invalid topic "${shortened(topic)}": it must have 1 to ${MAX_NAME_BYTES} bytes.`);
  }
  const found = NOT_IN_TOPIC.exec(topic) ?? CONTROL.exec(topic);
  if (found) {
    throw new BadTopicError(`Invalid topic "${shortened(topic)}": the character ${escaped(found[0])} is not allowed.`);
  }
  return topic;
}

/**
 * Return `name` if it is a valid node name: 1 to 200 bytes of UTF-8 without control characters.
 *
 * @throws {BadNameError} if it is invalid; the message contains the reason.
 */
export function checkNodeName(name: string): string {
  if (typeof name !== "string") throw new BadNameError("A node name must be a string.");
  if (!hasAllowedSize(name)) {
    throw new BadNameError(`Invalid node name "${shortened(name)}": it must have 1 to ${MAX_NAME_BYTES} bytes.`);
  }
  const found = CONTROL.exec(name);
  if (found) {
    throw new BadNameError(
      `Invalid node name "${shortened(name)}": the character ${escaped(found[0])} is not allowed.`,
    );
  }
  return name;
}

function shortened(text: string): string {
  return text.length > 60 ? `${text.slice(0, 60)}…` : text;
}

function escaped(letter: string): string {
  return letter === "{" || letter === " "
    ? `"${letter}"`
    : `U+${letter.charCodeAt(0).toString(16).toUpperCase().padStart(4, "0")}`;
}
