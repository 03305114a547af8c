/** Whether a level of the topic is a wildcard: `*` for one level, `**` for any number of levels. */
export function isPattern(topic: string): boolean {
  return topic.split("/").some((level) => level === "*" || level === "**");
}

/**
 * Whether a topic matches a pattern. A `*` stands for one level that is not empty, `**` for any number of
 * levels or none; all else is compared. Takes no longer than both have levels, multiplied.
 */
export function matchesPattern(pattern: string, topic: string): boolean {
  const parts = pattern.split("/");
  let places = withEmptyMatches(parts, new Set([0]));
  for (const level of topic.split("/")) {
    const next = new Set<number>();
    for (const place of places) {
      const part = parts[place];
      if (part === "**") next.add(place);
      else if (part === level || (part === "*" && level !== "")) next.add(place + 1);
    }
    places = withEmptyMatches(parts, next);
    if (places.size === 0) return false;
  }
  return places.has(parts.length);
}

function withEmptyMatches(parts: readonly string[], places: Set<number>): Set<number> {
  for (let place = 0; place < parts.length; place++) {
    if (places.has(place) && parts[place] === "**") places.add(place + 1);
  }
  return places;
}
