// The design tokens (resources/theme/tokens.json) as the page gets them from the window.

export interface BlockColours {
  primary: string;
  secondary: string;
  tertiary: string;
}

type Roles = Record<string, unknown>;
type LightDark<T> = {light: T; dark: T};

/** Either the whole file, or one mode of it (then `colour` and each block hold that mode's values). */
export interface Tokens {
  colour: Roles | LightDark<Roles>;
  block: Record<string, {icon: string} & (BlockColours | LightDark<BlockColours>)>;
}

/** Blockly's own style names, and a few plurals, mean ours. */
export const SAME_STYLE: Readonly<Record<string, string>> = {
  logic_blocks: 'values', math_blocks: 'values', text_blocks: 'values', colour_blocks: 'values',
  loop_blocks: 'control', list_blocks: 'variables', variable_blocks: 'variables',
  variable_dynamic_blocks: 'variables', procedure_blocks: 'functions', hat_blocks: 'events',
};

let current: Tokens | null = null;
let isDark = false;

export function useTokens(tokens: Tokens, dark: boolean): void {
  current = tokens;
  isDark = dark;
}

function modeOf<T extends object>(value: T | LightDark<T>): T {
  if (!('light' in value && 'dark' in value)) return value as T;
  return (value as LightDark<T>)[isDark ? 'dark' : 'light'];
}

/** The colour of a role in the present mode; a role nobody defined is a visible mistake. */
export function colour(role: string): string {
  const value = current ? modeOf<Roles>(current.colour)[role] : null;
  return typeof value === 'string' ? value : '#FF00FF';
}

export function roles(): [string, string][] {
  const all = current ? modeOf<Roles>(current.colour) : {};
  return Object.entries(all).filter((entry): entry is [string, string] => typeof entry[1] === 'string');
}

export function categories(): [string, BlockColours][] {
  return Object.entries(current?.block ?? {}).map(([name, each]) => [name, modeOf<BlockColours>(each)]);
}

export function categoryIcon(style: string): string {
  const name = SAME_STYLE[style] ?? style;
  return current?.block[name]?.icon ?? 'circle-dot';
}
