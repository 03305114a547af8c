/** Named values that travel beside a payload, such as an image's shape. */
export type Extension = Readonly<Record<string, unknown>>;
