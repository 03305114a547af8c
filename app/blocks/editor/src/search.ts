// Finding: blocks in the toolbox by words and synonyms, blocks in the workspace by what stands on them.
import * as Blockly from 'blockly/core';
import {definitionOf} from './definitions';
import {helpFor} from './help';
import {iconElement} from './icons';
import {t} from './words';

export type Entry = Record<string, unknown>;

function plain(words: string): string {
  return words.normalize('NFKD').replace(/[\u0300-\u036f]/g, '').toLowerCase().replace(/’/g, '\'')
    .replace(/\s+/g, ' ').trim();
}

/** Words of at least so many letters are found although one letter is wrong, missing or too many. */
const LONG = 4;

/** Whether two words differ by one letter at most, or by two neighbours that changed places. */
function isNear(one: string, other: string): boolean {
  const [short, long] = one.length <= other.length ? [one, other] : [other, one];
  if (long.length - short.length > 1) return false;
  let at = 0;
  while (at < short.length && short[at] === long[at]) at += 1;
  const rest = (from: number) => long.slice(from);
  if (short.length < long.length) return short.slice(at) === rest(at + 1);
  return short.slice(at + 1) === rest(at + 1) ||
    (short[at] === long[at + 1] && short[at + 1] === long[at] && short.slice(at + 2) === rest(at + 2));
}

/** Whether a word of the text begins nearly like this one. */
function hasNear(text: string, wanted: string): boolean {
  if (wanted.length < LONG) return false;
  return text.split(' ').some((word) => word.length >= LONG - 1 && [0, -1, 1].some((more) =>
    isNear(word.slice(0, wanted.length + more), wanted)));
}

/** Where a word may be found, with what that is worth: on the block, in a choice of it, in lists of other words. */
interface Searched {
  title: string;
  choices: string[];
  /** Words for which it comes before what is called so. */
  leads: Set<string>;
  lists: [text: string, worth: number, ofBeginning: number, first: number][];
  told: string;
}

/** More than a block can have that is called so. */
const LEADS = 15;
/** Less than this is found in what is told about a block, not in what it is called. */
const CALLED = 3;

function searched(entry: Entry): Searched {
  const type = String(entry['type']);
  const help = helpFor(type);
  const shown = Object.values((entry['fields'] ?? {}) as object).filter((each) => typeof each === 'string').join(' ');
  const name = String((entry['extraState'] as {name?: unknown} | undefined)?.name ?? '');
  const gaps = /\([^)]*\)|%\d+/g;
  const title = plain(`${name} ${(help?.title ?? String(definitionOf(type)?.['message0'] ?? '')).replace(gaps, ' ')} ${shown}`);
  const choices = (help?.choices ?? []).map(plain);
  const list = (words: string) => plain(words.replace(/,/g, ' ').replace(/([^\s=])!/g, '$1'));
  const leads = `${help?.words ?? ''}, ${help?.english ?? ''}`.split(',').map(plain)
    .filter((each) => /[^!]!$/.test(each)).map((each) => each.slice(0, -1));
  return {
    title,
    choices,
    leads: new Set(leads),
    lists: [[title, 7, 6.5, 9], [choices.join(' '), 7, 5, 7], [list(help?.words ?? ''), 6, 5.5, 8],
      [list(help?.english ?? ''), 4, 3.5, 5]],
    told: plain(`${help?.does ?? ''} ${help?.more ?? ''} ${help?.gaps.map(([, words]) => words).join(' ') ?? ''}`),
  };
}

/**
 * How well one word is answered; 0 is not at all.
 *
 * A whole word is worth more than the beginning of one, and the first word more than the others: what a block begins
 * with, and what most people call it instead.
 */
function worthOf({title, leads, lists, told}: Searched, word: string): number {
  if (leads.has(word)) return LEADS;
  const found = lists.map(([text, worth, ofBeginning, first]) => `${text} `.startsWith(`${word} `) ? first :
    ` ${text} `.includes(` ${word} `) ? worth : ` ${text}`.includes(` ${word}`) ? ofBeginning : 0);
  if (found.some(Boolean)) return Math.max(...found);
  if (word.length >= LONG - 1 && title.includes(word)) return CALLED;
  return ` ${told}`.includes(` ${word}`) ? 1 : 0;
}

function nearWorthOf({lists}: Searched, word: string): number {
  const found = lists.map(([text, worth, , first]) => !hasNear(text, word) ? 0 :
    hasNear(text.split(' ', 1)[0] ?? '', word) ? first : worth);
  return found.some(Boolean) ? CALLED + Math.max(...found) / 10 : 0;
}

/**
 * The entries that answer, best first.
 *
 * The words may come in any order. One that nothing has may have a wrong letter. When nothing answers to all of them,
 * the blocks that are called by most of them do.
 */
export function findEntries(entries: Entry[], words: string, most = 40): Entry[] {
  const wanted = [...new Set(plain(words).split(/[\s,]+/).filter(Boolean))];
  if (!wanted.length) return [];
  const known = entries.map(searched);
  const worths = wanted.map((word) => {
    const exact = known.map((each) => worthOf(each, word));
    return exact.some(Boolean) ? exact : known.map((each) => nearWorthOf(each, word));
  });
  const whole = wanted.join(' ');
  const answers = entries.map((entry, place) => {
    const own = worths.map((each) => each[place] ?? 0);
    const {title, choices} = known[place] as Searched;
    const begins = title.startsWith(whole) || choices.some((choice) => `${choice} `.startsWith(`${whole} `));
    return {
      entry,
      answered: own.every(Boolean) ? wanted.length : own.filter((worth) => worth >= CALLED).length,
      worth: own.reduce((sum, each) => sum + each, 0) / wanted.length + (begins ? 5 : 0),
    };
  });
  const best = Math.max(...answers.map(({answered}) => answered));
  return answers.filter(({answered}) => answered > 0 && answered === best)
    .sort((one, other) => other.worth - one.worth)
    .slice(0, most).map(({entry}) => entry);
}

/** What stands on a block, without the blocks in it. */
function wordsOf(block: Blockly.Block): string {
  const own = block.inputList.flatMap((input) => input.fieldRow).map((field) => field.getText());
  return plain(own.join(' '));
}

/**
 * The bar that finds blocks in the workspace.
 *
 * Not Blockly's own plug-in for it: that is bound to one workspace (each tab has its own), tells no count, speaks
 * English only, needs accents typed exactly, does not look again after an edit, and opens on Ctrl+F by itself.
 */
export class FindBar {
  private readonly bar = document.createElement('div');
  private readonly words = document.createElement('input');
  private readonly count = document.createElement('span');
  private found: Blockly.BlockSvg[] = [];
  private at = -1;
  private timer = 0;

  constructor(private readonly workspace: () => Blockly.WorkspaceSvg) {
    this.bar.className = 'nepFind';
    this.bar.setAttribute('role', 'search');
    this.bar.hidden = true;
    this.words.type = 'search';
    this.words.placeholder = t('Find in blocks');
    this.words.setAttribute('aria-label', t('Find in blocks'));
    this.words.spellcheck = false;
    this.count.setAttribute('role', 'status');
    this.words.oninput = () => this.search();
    this.bar.onkeydown = (event) => this.onKey(event);
    this.bar.append(iconElement('search', 16), this.words, this.count,
      this.button('arrow-up', t('Previous (Shift+Enter)'), () => this.step(-1)),
      this.button('arrow-down', t('Next (Enter)'), () => this.step(1)),
      this.button('x', t('Close (Esc)'), () => this.close()));
    document.body.append(this.bar);
  }

  open(): void {
    const already = !this.bar.hidden;
    this.bar.hidden = false;
    this.words.focus();
    this.words.select();
    if (!already || this.words.value) this.search();
  }

  /** Another behaviour, or other blocks: look again when the bar is open. */
  again(): void {
    if (this.bar.hidden) return;
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.search(false), 100);
  }

  close(): void {
    if (this.bar.hidden) return;
    const block = this.found[this.at];
    this.bar.hidden = true;
    this.mark([]);
    if (block && !block.isDeadOrDying()) Blockly.getFocusManager().focusNode(block);
    else Blockly.getFocusManager().focusTree(this.workspace());
  }

  private button(icon: string, words: string, action: () => void): HTMLButtonElement {
    const made = document.createElement('button');
    made.type = 'button';
    made.title = words;
    made.setAttribute('aria-label', words);
    made.append(iconElement(icon, 16));
    made.onclick = action;
    return made;
  }

  private onKey(event: KeyboardEvent): void {
    event.stopPropagation();
    if (event.key === 'Escape') this.close();
    else if (event.key === 'Enter' && event.target === this.words) this.step(event.shiftKey ? -1 : 1);
    else return;
    event.preventDefault();
  }

  private search(moves = true): void {
    const wanted = plain(this.words.value);
    const before = this.found[this.at];
    const all = wanted ? this.workspace().getAllBlocks(true).filter((block) => !block.isInsertionMarker()) : [];
    this.mark(all.filter((block) => wordsOf(block).includes(wanted)));
    this.at = before ? this.found.indexOf(before) : -1;
    if (this.at < 0 && moves && this.found.length) this.step(1);
    else this.show();
  }

  private mark(blocks: Blockly.BlockSvg[]): void {
    for (const block of this.found) block.getSvgRoot()?.classList.remove('nepFound', 'nepFoundNow');
    this.found = blocks;
    this.at = -1;
    for (const block of blocks) block.getSvgRoot().classList.add('nepFound');
  }

  private step(by: number): void {
    if (this.found.length) {
      this.at = (this.at + by + this.found.length + (this.at < 0 && by < 0 ? 1 : 0)) % this.found.length;
      const block = this.found[this.at];
      if (block && !block.isDeadOrDying()) this.workspace().centerOnBlock(block.id, true);
    }
    this.show();
  }

  private show(): void {
    this.found.forEach((block, number) => block.getSvgRoot()?.classList.toggle('nepFoundNow', number === this.at));
    this.count.textContent = !this.words.value.trim() ? '' :
      this.found.length ? t('{number} of {count}', {number: this.at + 1, count: this.found.length}) : t('No results');
    this.bar.classList.toggle('none', Boolean(this.words.value.trim()) && !this.found.length);
  }
}
