// Parses typed numbers with a comma or point as decimal separator. The rules and the test examples
// (tests/data/typed_numbers.json) are those of app/robots/description/typed_number.py.

/** Reason why a text is rejected: several separators, or not a number. */
export type Rejection = 'separators' | 'not a number';

const NUMBER = /^[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[+-]?\d+)?$/i;
const GROUPED = /^[+-]?\d[\d.,'’ _]*$/;

/** Returns the typed number. Thousands separators are rejected, not removed: "1.234" is ambiguous. */
export function parseNumber(text: string): number | Rejection {
  const typed = text.normalize('NFKC').trim().replace('\u2212', '-');
  const number = NUMBER.test(typed) ? Number(typed.replace(',', '.')) : NaN;
  if (Number.isFinite(number)) return number;
  return GROUPED.test(typed) ? 'separators' : 'not a number';
}
