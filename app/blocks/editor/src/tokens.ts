// Design tokens (resources/theme/tokens.json) as passed to the page by the window.

export interface BlockColours {
  primary: string;
  secondary: string;
  tertiary: string;
}

type Roles = Record<string, unknown>;
type LightDark<T> = {light: T; dark: T};

/** The whole file, or a single mode of it, in which `colour` and each block hold the values of that mode. */
export interface Tokens {
  colour: Roles | LightDark<Roles>;
  block: Record<string, {icon: string} & (BlockColours | LightDark<BlockColours>)>;
}

/** Maps Blockly's style names and some plurals to the styles of this editor. */
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

/** Returns the colour of a role in the current mode; an unknown role gets a conspicuous colour. */
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
