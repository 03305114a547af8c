/** Named values sent with a payload, such as the shape of an image. */
export type Extension = Readonly<Record<string, unknown>>;
