/** Image codec: JPEG or PNG files, or raw pixels with their shape. The bytes are not converted. */
import { DecodeError, EncodeError } from "../errors.js";
import { copied, isShared, shared } from "./copying.js";
import type { Extension } from "../wire/extension.js";

/** Image published or received on a topic of type `image`. */
export interface Image {
  /** Bytes of a JPEG or PNG file, or raw pixels row by row without padding, little-endian. */
  readonly data: Uint8Array;
  /** `jpeg`, `png`, or the layout of raw pixels: `mono8`, `rgb8`, `bgra16`, `32FC1`, … */
  readonly encoding: string;
  /** Height and width in pixels, and number of channels. Optional for files. */
  readonly shape?: readonly [number, number, number];
}

const NAMED: Readonly<Record<string, readonly [bytes: number, channels: number]>> = {
  mono8: [1, 1],
  bgr8: [1, 3],
  rgb8: [1, 3],
  bgra8: [1, 4],
  rgba8: [1, 4],
  mono16: [2, 1],
  bgr16: [2, 3],
  rgb16: [2, 3],
  bgra16: [2, 4],
  rgba16: [2, 4],
};
const NUMBER_BYTES: Readonly<Record<string, number>> = {
  "8U": 1,
  "8S": 1,
  "16U": 2,
  "16S": 2,
  "32S": 4,
  "32F": 4,
  "64F": 8,
};
const PNG_SIGNATURE = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);

/** Return bytes per number and channels per pixel of a raw layout; undefined if the name is unknown. */
export function rawLayout(encoding: string): readonly [bytes: number, channels: number] | undefined {
  const match = /^(8U|8S|16U|16S|32S|32F|64F)C([1-4])$/.exec(encoding);
  return match ? [NUMBER_BYTES[match[1]!]!, Number(match[2])] : NAMED[encoding];
}

/** Return `jpeg` or `png` if the bytes are such a file, else undefined. */
export function fileKind(data: Uint8Array): "jpeg" | "png" | undefined {
  if (data[0] === 0xff && data[1] === 0xd8 && data[2] === 0xff) return "jpeg";
  return PNG_SIGNATURE.every((each, index) => data[index] === each) ? "png" : undefined;
}

/** Encode an {@link Image}, or the bytes of a JPEG or PNG file. @throws {EncodeError} */
export function encodeImage(payload: unknown): { data: Buffer; extension: Extension } {
  const image = (ArrayBuffer.isView(payload) ? { data: payload } : payload) as Partial<Image> | null;
  if (!(image?.data instanceof Uint8Array)) {
    throw new EncodeError(
      'A topic of type "image" takes the bytes of a JPEG or PNG file, or {data, encoding, shape}.',
    );
  }
  const data = isShared(image.data) ? image.data : copied(image.data);
  const kind = fileKind(data);
  if (kind) {
    const shape = image.shape ?? (kind === "png" ? pngShape(data) : jpegShape(data));
    return { data, extension: shape ? { shape, encoding: kind } : { encoding: kind } };
  }
  const layout = rawLayout(image.encoding ?? "");
  if (!layout || !image.shape) throw new EncodeError('Raw pixels need a known encoding such as "rgb8" and a shape.');
  const [height, width, channels] = image.shape;
  if (channels !== layout[1] || height * width * channels * layout[0] !== data.length) {
    throw new EncodeError(`${data.length} bytes don't match "${image.encoding}" of ${height} × ${width} × ${channels}.`);
  }
  return { data, extension: { shape: [height, width, channels], encoding: image.encoding } };
}

/** Decode an {@link Image}. The format of a file is detected from its bytes. @throws {DecodeError} */
export function decodeImage(data: Buffer, extension: Extension): Image {
  shared(data);
  const shape = readShape(extension["shape"]);
  const kind = fileKind(data);
  if (kind) return { data, encoding: kind, ...(shape && { shape }) };
  const encoding = extension["encoding"];
  const layout = typeof encoding === "string" ? rawLayout(encoding) : undefined;
  if (!layout || !shape || typeof encoding !== "string")
    throw new DecodeError(`The payload of ${data.length} bytes is not an image.`);
  if (shape[2] !== layout[1] || shape[0] * shape[1] * shape[2] * layout[0] !== data.length) {
    throw new DecodeError(`${data.length} bytes don't match "${encoding}" of ${shape.join(" × ")}.`);
  }
  return { data, encoding, shape };
}

function readShape(value: unknown): [number, number, number] | undefined {
  if (!Array.isArray(value) || value.length !== 3) return undefined;
  const numbers = value.map(Number);
  return numbers.every((each) => Number.isSafeInteger(each) && each > 0)
    ? (numbers as [number, number, number])
    : undefined;
}

function pngShape(data: Buffer): [number, number, number] | undefined {
  if (data.length < 26) return undefined;
  const channels = { 0: 1, 2: 3, 3: 3, 4: 2, 6: 4 }[data[25]!];
  return channels ? [data.readUInt32BE(20), data.readUInt32BE(16), channels] : undefined;
}

function jpegShape(data: Buffer): [number, number, number] | undefined {
  let at = 2;
  while (at + 10 <= data.length && data[at] === 0xff) {
    const marker = data[at + 1]!;
    const isFrame = marker >= 0xc0 && marker <= 0xcf && ![0xc4, 0xc8, 0xcc].includes(marker);
    if (isFrame) return [data.readUInt16BE(at + 5), data.readUInt16BE(at + 7), data[at + 9]!];
    at += 2 + data.readUInt16BE(at + 2);
  }
  return undefined;
}
