// Translations, keyed by their English text: `t('Delete {count} blocks', {count})`.

let translations: Readonly<Record<string, string>> = {};

/** Sets the translations; called before the user interface is created. */
export function setTranslations(catalog: Readonly<Record<string, string>>): void {
  translations = catalog;
}

/** Returns the translation of a whole sentence with its placeholders filled in; falls back to English. */
export function t(english: string, values: Readonly<Record<string, string | number>> = {}): string {
  const text = Object.hasOwn(translations, english) ? translations[english] ?? english : english;
  return text.replace(/\{(\w+)\}/g, (placeholder, name: string) => Object.hasOwn(values, name) ? String(values[name]) : placeholder);
}

/** Marks a constant for translation; pass it to `t` where it is shown. */
export function lazy(english: string): string {
  return english;
}
