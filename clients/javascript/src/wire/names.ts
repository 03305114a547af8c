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
 * Return `topic` if the wire allows it: 1 to 200 bytes of UTF-8 without white space, control characters and `{`.
 *
 * @throws {BadTopicError} with the reason.
 */
export function checkTopic(topic: string): string {
  if (typeof topic !== "string") throw new BadTopicError("A topic is a string.");
  if (!hasAllowedSize(topic)) {
    throw new BadTopicError(`"${shortened(topic)}" is no topic: 1 to ${MAX_NAME_BYTES} bytes are allowed.`);
  }
  const found = NOT_IN_TOPIC.exec(topic) ?? CONTROL.exec(topic);
  if (found) {
    throw new BadTopicError(`"${shortened(topic)}" is no topic: the character ${escaped(found[0])} is not allowed.`);
  }
  return topic;
}

/**
 * Return `name` if a node may have it: 1 to 200 bytes of UTF-8 without control characters.
 *
 * @throws {BadNameError} with the reason.
 */
export function checkNodeName(name: string): string {
  if (typeof name !== "string") throw new BadNameError("A node name is a string.");
  if (!hasAllowedSize(name)) {
    throw new BadNameError(`"${shortened(name)}" is no node name: 1 to ${MAX_NAME_BYTES} bytes are allowed.`);
  }
  const found = CONTROL.exec(name);
  if (found) {
    throw new BadNameError(
      `"${shortened(name)}" is no node name: the character ${escaped(found[0])} is not allowed.`,
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
