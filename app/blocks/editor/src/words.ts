// Our words in the language of the window, by their English: `t('Delete {count} blocks', {count})`.

let translations: Readonly<Record<string, string>> = {};

/** The window tells the words before anything is made. */
export function setTranslations(catalog: Readonly<Record<string, string>>): void {
  translations = catalog;
}

/** A whole sentence; its holes are filled afterwards. English when nobody has translated it. */
export function t(english: string, holes: Readonly<Record<string, string | number>> = {}): string {
  const text = Object.hasOwn(translations, english) ? translations[english] ?? english : english;
  return text.replace(/\{(\w+)\}/g, (hole, name: string) => Object.hasOwn(holes, name) ? String(holes[name]) : hole);
}

/** Marks a constant for translators; give it to `t` where it is shown. */
export function lazy(english: string): string {
  return english;
}
