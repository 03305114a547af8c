// Finding: blocks in the toolbox by words and synonyms, blocks in the workspace by what stands on them.
import * as Blockly from 'blockly/core';
import {definitionOf} from './definitions';
import {helpFor} from './help';
import {iconElement} from './icons';
import {t} from './words';

export type Entry = Record<string, unknown>;

function plain(words: string): string {
  return words.normalize('NFKD').replace(/[\u0300-\u036f]/g, '').toLowerCase().replace(/\s+/g, ' ').trim();
}

/** How well a toolbox entry answers; 0 is not at all. */
function score(entry: Entry, wanted: string[]): number {
  const type = String(entry['type']);
  const help = helpFor(type);
  const shown = Object.values((entry['fields'] ?? {}) as object).filter((each) => typeof each === 'string').join(' ');
  const name = String((entry['extraState'] as {name?: unknown} | undefined)?.name ?? '');
  const gaps = /\([^)]*\)|%\d+/g;
  const title = plain(`${name} ${(help?.title ?? String(definitionOf(type)?.['message0'] ?? '')).replace(gaps, ' ')} ${shown}`);
  const also = plain(help?.words ?? '');
  const told = plain(`${help?.does ?? ''} ${help?.more ?? ''} ${help?.gaps.map(([, words]) => words).join(' ') ?? ''}`);
  const has = (text: string, word: string) => ` ${text}`.includes(` ${word}`);
  let sum = 0;
  for (const word of wanted) {
    const worth = has(title, word) ? 9 : has(also, word) ? 6 : title.includes(word) ? 4 : has(told, word) ? 2 : 0;
    if (!worth) return 0;
    sum += worth;
  }
  return sum / wanted.length + (title.startsWith(wanted.join(' ')) ? 5 : 0);
}

/** The entries that answer, best first. */
export function findEntries(entries: Entry[], words: string, most = 40): Entry[] {
  const wanted = plain(words).split(' ').filter(Boolean);
  if (!wanted.length) return [];
  return entries.map((entry, place) => ({entry, place, worth: score(entry, wanted)}))
    .filter(({worth}) => worth > 0)
    .sort((one, other) => other.worth - one.worth || one.place - other.place)
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
    this.words.placeholder = t('Find in the blocks');
    this.words.setAttribute('aria-label', t('Find in the blocks'));
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
      this.found.length ? t('{number} of {count}', {number: this.at + 1, count: this.found.length}) : t('none');
    this.bar.classList.toggle('none', Boolean(this.words.value.trim()) && !this.found.length);
  }
}
