/** Return true if a level of the topic is a wildcard: `*` for one level, `**` for any number of levels. */
export function isPattern(topic: string): boolean {
  return topic.split("/").some((level) => level === "*" || level === "**");
}

/**
 * Return true if a topic matches a pattern. `*` matches one nonempty level, `**` any number of levels including none;
 * other levels are compared. The running time is at most proportional to the product of the numbers of levels.
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
