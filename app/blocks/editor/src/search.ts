// Search: blocks of the toolbox by words and synonyms, blocks of the workspace by their text.
import * as Blockly from 'blockly/core';
import {definitionOf} from './definitions';
import {helpFor} from './help';
import {iconElement} from './icons';
import {t} from './words';

export type Entry = Record<string, unknown>;

function normalize(text: string): string {
  return text.normalize('NFKD').replace(/[\u0300-\u036f]/g, '').toLowerCase().replace(/’/g, '\'')
    .replace(/\s+/g, ' ').trim();
}

/** Minimum length in letters of a word that matches with one typing error. */
const MIN_FUZZY_LENGTH = 4;

/** Returns true if two words differ by at most one letter or by two transposed neighbours. */
function isSimilar(word: string, other: string): boolean {
  const [short, long] = word.length <= other.length ? [word, other] : [other, word];
  if (long.length - short.length > 1) return false;
  let index = 0;
  while (index < short.length && short[index] === long[index]) index += 1;
  const rest = (from: number) => long.slice(from);
  if (short.length < long.length) return short.slice(index) === rest(index + 1);
  return short.slice(index + 1) === rest(index + 1) ||
    (short[index] === long[index + 1] && short[index + 1] === long[index] && short.slice(index + 2) === rest(index + 2));
}

/** Returns true if a word of the text begins approximately with the query. */
function hasSimilarWord(text: string, query: string): boolean {
  if (query.length < MIN_FUZZY_LENGTH) return false;
  return text.split(' ').some((word) => word.length >= MIN_FUZZY_LENGTH - 1 && [0, -1, 1].some((more) =>
    isSimilar(word.slice(0, query.length + more), query)));
}

/** Search index of a toolbox entry: texts and their weights. */
interface IndexedEntry {
  title: string;
  choices: string[];
  /** Words for which this entry ranks above entries with the word in their title. */
  leads: Set<string>;
  lists: [text: string, wordScore: number, prefixScore: number, firstWordScore: number][];
  descriptionText: string;
}

/** Score of a leading word; above the highest title score. */
const LEAD_SCORE = 15;
/** Minimum score of a match in the title, choices or synonyms; description matches score less. */
const MIN_TITLE_SCORE = 3;

function indexEntry(entry: Entry): IndexedEntry {
  const type = String(entry['type']);
  const help = helpFor(type);
  const fieldText = Object.values((entry['fields'] ?? {}) as object).filter((value) => typeof value === 'string').join(' ');
  const name = String((entry['extraState'] as {name?: unknown} | undefined)?.name ?? '');
  const gaps = /\([^)]*\)|%\d+/g;
  const title = normalize(`${name} ${(help?.title ?? String(definitionOf(type)?.['message0'] ?? '')).replace(gaps, ' ')} ${fieldText}`);
  const choices = (help?.choices ?? []).map(normalize);
  const list = (text: string) => normalize(text.replace(/,/g, ' ').replace(/([^\s=])!/g, '$1'));
  const leads = `${help?.words ?? ''}, ${help?.english ?? ''}`.split(',').map(normalize)
    .filter((phrase) => /[^!]!$/.test(phrase)).map((phrase) => phrase.slice(0, -1));
  return {
    title,
    choices,
    leads: new Set(leads),
    lists: [[title, 7, 6.5, 9], [choices.join(' '), 7, 5, 7], [list(help?.words ?? ''), 6, 5.5, 8],
      [list(help?.english ?? ''), 4, 3.5, 5]],
    descriptionText: normalize(`${help?.does ?? ''} ${help?.more ?? ''} ${help?.gaps.map(([, words]) => words).join(' ') ?? ''}`),
  };
}

/**
 * Returns the score of an entry for one word; 0 means no match.
 *
 * A whole word scores higher than a prefix, and the first word of a list higher than the others: it is the first
 * word on the block or its most common synonym.
 */
function scoreOf({title, leads, lists, descriptionText}: IndexedEntry, word: string): number {
  if (leads.has(word)) return LEAD_SCORE;
  const scores = lists.map(([text, wordScore, prefixScore, firstWordScore]) => `${text} `.startsWith(`${word} `) ? firstWordScore :
    ` ${text} `.includes(` ${word} `) ? wordScore : ` ${text}`.includes(` ${word}`) ? prefixScore : 0);
  if (scores.some(Boolean)) return Math.max(...scores);
  if (word.length >= MIN_FUZZY_LENGTH - 1 && title.includes(word)) return MIN_TITLE_SCORE;
  return ` ${descriptionText}`.includes(` ${word}`) ? 1 : 0;
}

function fuzzyScoreOf({lists}: IndexedEntry, word: string): number {
  const scores = lists.map(([text, wordScore, , firstWordScore]) => !hasSimilarWord(text, word) ? 0 :
    hasSimilarWord(text.split(' ', 1)[0] ?? '', word) ? firstWordScore : wordScore);
  return scores.some(Boolean) ? MIN_TITLE_SCORE + Math.max(...scores) / 10 : 0;
}

/**
 * Returns the matching entries, best first.
 *
 * Words match in any order. A word without an exact match may contain one typing error. If no entry matches all
 * words, the entries that match most of them in their title or synonyms are returned.
 */
export function findEntries(entries: Entry[], query: string, limit = 40): Entry[] {
  const queryWords = [...new Set(normalize(query).split(/[\s,]+/).filter(Boolean))];
  if (!queryWords.length) return [];
  const indexedEntries = entries.map(indexEntry);
  const scoresByWord = queryWords.map((word) => {
    const exact = indexedEntries.map((indexed) => scoreOf(indexed, word));
    return exact.some(Boolean) ? exact : indexedEntries.map((indexed) => fuzzyScoreOf(indexed, word));
  });
  const fullQuery = queryWords.join(' ');
  const results = entries.map((entry, index) => {
    const scores = scoresByWord.map((wordScores) => wordScores[index] ?? 0);
    const {title, choices} = indexedEntries[index] as IndexedEntry;
    const isPrefix = title.startsWith(fullQuery) || choices.some((choice) => `${choice} `.startsWith(`${fullQuery} `));
    return {
      entry,
      matchedWords: scores.every(Boolean) ? queryWords.length : scores.filter((score) => score >= MIN_TITLE_SCORE).length,
      score: scores.reduce((sum, score) => sum + score, 0) / queryWords.length + (isPrefix ? 5 : 0),
    };
  });
  const best = Math.max(...results.map(({matchedWords}) => matchedWords));
  return results.filter(({matchedWords}) => matchedWords > 0 && matchedWords === best)
    .sort((result, other) => other.score - result.score)
    .slice(0, limit).map(({entry}) => entry);
}

/** Returns the normalized text of a block's own fields, without its children. */
function blockText(block: Blockly.Block): string {
  const texts = block.inputList.flatMap((input) => input.fieldRow).map((field) => field.getText());
  return normalize(texts.join(' '));
}

/**
 * Search bar for blocks in the workspace.
 *
 * Replaces Blockly's workspace search plug-in, which is bound to one workspace (each tab has its own), shows no
 * count, is in English only, is sensitive to accents, doesn't update after edits, and takes Ctrl+F itself.
 */
export class FindBar {
  private readonly bar = document.createElement('div');
  private readonly input = document.createElement('input');
  private readonly count = document.createElement('span');
  private matches: Blockly.BlockSvg[] = [];
  private currentIndex = -1;
  private timer = 0;

  constructor(private readonly workspace: () => Blockly.WorkspaceSvg) {
    this.bar.className = 'nepFind';
    this.bar.setAttribute('role', 'search');
    this.bar.hidden = true;
    this.input.type = 'search';
    this.input.placeholder = t('Find in blocks');
    this.input.setAttribute('aria-label', t('Find in blocks'));
    this.input.spellcheck = false;
    this.count.setAttribute('role', 'status');
    this.input.oninput = () => this.search();
    this.bar.onkeydown = (event) => this.onKey(event);
    this.bar.append(iconElement('search', 16), this.input, this.count,
      this.createButton('arrow-up', t('Previous (Shift+Enter)'), () => this.step(-1)),
      this.createButton('arrow-down', t('Next (Enter)'), () => this.step(1)),
      this.createButton('x', t('Close (Esc)'), () => this.close()));
    document.body.append(this.bar);
  }

  open(): void {
    const already = !this.bar.hidden;
    this.bar.hidden = false;
    this.input.focus();
    this.input.select();
    if (!already || this.input.value) this.search();
  }

  /** Repeats the search after an edit or a change of tab, if the bar is open. */
  refresh(): void {
    if (this.bar.hidden) return;
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.search(false), 100);
  }

  close(): void {
    if (this.bar.hidden) return;
    const block = this.matches[this.currentIndex];
    this.bar.hidden = true;
    this.setMatches([]);
    if (block && !block.isDeadOrDying()) Blockly.getFocusManager().focusNode(block);
    else Blockly.getFocusManager().focusTree(this.workspace());
  }

  private createButton(icon: string, label: string, action: () => void): HTMLButtonElement {
    const button = document.createElement('button');
    button.type = 'button';
    button.title = label;
    button.setAttribute('aria-label', label);
    button.append(iconElement(icon, 16));
    button.onclick = action;
    return button;
  }

  private onKey(event: KeyboardEvent): void {
    event.stopPropagation();
    if (event.key === 'Escape') this.close();
    else if (event.key === 'Enter' && event.target === this.input) this.step(event.shiftKey ? -1 : 1);
    else return;
    event.preventDefault();
  }

  private search(shouldSelectMatch = true): void {
    const query = normalize(this.input.value);
    const before = this.matches[this.currentIndex];
    const all = query ? this.workspace().getAllBlocks(true).filter((block) => !block.isInsertionMarker()) : [];
    this.setMatches(all.filter((block) => blockText(block).includes(query)));
    this.currentIndex = before ? this.matches.indexOf(before) : -1;
    if (this.currentIndex < 0 && shouldSelectMatch && this.matches.length) this.step(1);
    else this.render();
  }

  private setMatches(blocks: Blockly.BlockSvg[]): void {
    for (const block of this.matches) block.getSvgRoot()?.classList.remove('nepFound', 'nepFoundNow');
    this.matches = blocks;
    this.currentIndex = -1;
    for (const block of blocks) block.getSvgRoot().classList.add('nepFound');
  }

  private step(by: number): void {
    if (this.matches.length) {
      this.currentIndex = (this.currentIndex + by + this.matches.length + (this.currentIndex < 0 && by < 0 ? 1 : 0)) % this.matches.length;
      const block = this.matches[this.currentIndex];
      if (block && !block.isDeadOrDying()) this.workspace().centerOnBlock(block.id, true);
    }
    this.render();
  }

  private render(): void {
    this.matches.forEach((block, number) => block.getSvgRoot()?.classList.toggle('nepFoundNow', number === this.currentIndex));
    this.count.textContent = !this.input.value.trim() ? '' :
      this.matches.length ? t('{number} of {count}', {number: this.currentIndex + 1, count: this.matches.length}) : t('No results');
    this.bar.classList.toggle('none', Boolean(this.input.value.trim()) && !this.matches.length);
  }
}
