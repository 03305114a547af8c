// Numbers as people type them: comma and point are both decimal separators. The same rules as app/robots/description/typed_number.py,
// tested with the same examples (tests/data/typed_numbers.json).

/** Why a text is rejected: it has several separators, or it is no number at all. */
export type Rejection = 'separators' | 'not a number';

const NUMBER = /^[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[+-]?\d+)?$/i;
const GROUPED = /^[+-]?\d[\d.,'’ _]*$/;

/** The number that a person typed. Thousands separators are rejected, not removed: "1.234" may mean either. */
export function parseNumber(text: string): number | Rejection {
  const typed = text.normalize('NFKC').trim().replace('\u2212', '-');
  const number = NUMBER.test(typed) ? Number(typed.replace(',', '.')) : NaN;
  if (Number.isFinite(number)) return number;
  return GROUPED.test(typed) ? 'separators' : 'not a number';
}
