// Search field above the toolbox; Enter picks the first matching block.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {type Entry, findEntries} from './search';
import {t} from './words';

export const SEARCH = 'nepSearch';

/** Debounce time: results are rendered once per word instead of once per letter. */
const DEBOUNCE_MS = 80;
/** Minimum height of a block in the toolbox, including the gap below it. */
const BLOCK_HEIGHT = 50;
const SHOW_ALL = 'SHOW_ALL_FOUND';

/** Methods of the toolbox that the search field calls. */
interface SearchableToolbox {
  allEntries(): Entry[];
  showFound(entries: unknown[] | null): void;
  showAllFound(entries: unknown[], before: number): void;
  enterFound(event: KeyboardEvent | null): void;
}

/** State of a search field: its text, the selection in it, and whether results are pending. */
interface SearchState {
  words: string;
  selection: [start: number, end: number];
  hasFocus: boolean;
  isPending: boolean;
}

export class SearchItem extends Blockly.ToolboxItem {
  private readonly div = document.createElement('div');
  private readonly field = document.createElement('input');
  private waiting = 0;

  override init(): void {
    this.div.className = 'nepSearch';
    this.div.setAttribute('role', 'search');
    this.field.type = 'search';
    this.field.placeholder = t('Find a block');
    this.field.spellcheck = false;
    this.field.setAttribute('aria-label', t('Find a block: type words and press Enter to select the first result'));
    this.field.title = t('Find a block');
    this.field.onfocus = () => this.updateExpanded();
    this.field.onblur = () => {
      // Moving the focus inside the page cancels the search; switching to another window doesn't.
      if (document.hasFocus()) this.cancelSearch();
      this.updateExpanded();
    };
    this.field.oninput = () => this.scheduleSearch();
    this.field.onkeydown = (event) => this.onKey(event);
    // Otherwise the toolbox treats the press as a click outside its categories and closes the flyout.
    this.div.onpointerdown = (event) => event.stopPropagation();
    this.div.append(iconElement('search', 16), this.field);
    this.parentToolbox_.getWorkspace().registerButtonCallback(SHOW_ALL, () => {
      this.toolbox.showAllFound(this.getMatches(), this.atFirst);
    });
  }

  override getDiv(): Element {
    return this.div;
  }

  override canBeFocused(): boolean {
    return false;
  }

  override dispose(): void {
    this.cancelSearch();
    this.div.remove();
  }

  focus(): void {
    this.field.focus();
    this.field.select();
    if (this.field.value) this.showResults();
  }

  clear(): void {
    this.cancelSearch();
    this.field.value = '';
    this.updateExpanded();
  }

  /** Text and focus, to be restored in the field that replaces this one. */
  get query(): SearchState {
    const {value, selectionStart, selectionEnd} = this.field;
    return {
      words: value,
      selection: [selectionStart ?? 0, selectionEnd ?? 0],
      hasFocus: document.activeElement === this.field,
      isPending: this.waiting !== 0,
    };
  }

  /** Restores the text and focus of the field that this one replaces. */
  restore({words, selection, hasFocus, isPending}: SearchState): void {
    this.field.value = words;
    if (hasFocus) this.field.focus();
    this.field.setSelectionRange(...selection);
    this.updateExpanded();
    if (isPending) this.scheduleSearch();
  }

  /** Repeats the search if the field has text. */
  refresh(): void {
    if (this.field.value.trim()) this.showResults();
  }

  /** Expands a compact toolbox (tiles only) while the search is active. */
  private updateExpanded(): void {
    const isExpanded = document.activeElement === this.field || this.field.value !== '';
    const box = this.div.closest('.blocklyToolbox');
    if (!box || box.classList.contains('nepWhole') === isExpanded) return;
    box.classList.toggle('nepWhole', isExpanded);
    const workspace = this.parentToolbox_.getWorkspace();
    if (workspace.getParentSvg().isConnected) Blockly.svgResize(workspace);
  }

  private get toolbox(): SearchableToolbox {
    return this.parentToolbox_ as unknown as SearchableToolbox;
  }

  private scheduleSearch(): void {
    this.cancelSearch();
    this.waiting = window.setTimeout(() => this.showResults(), DEBOUNCE_MS);
  }

  /** Shows pending results immediately. */
  private flushSearch(): void {
    if (this.waiting) this.showResults();
  }

  private cancelSearch(): void {
    window.clearTimeout(this.waiting);
    this.waiting = 0;
  }

  private getMatches(): Entry[] {
    return findEntries(this.toolbox.allEntries(), this.field.value);
  }

  /** Number of results to render first: as many as fit into the viewport, and one more. */
  private get atFirst(): number {
    const {height} = this.parentToolbox_.getWorkspace().getCachedParentSvgSize();
    return Math.max(8, Math.ceil(height / BLOCK_HEIGHT) + 1);
  }

  private showResults(): void {
    this.cancelSearch();
    const query = this.field.value;
    if (!query.trim()) {
      this.toolbox.showFound(null);
      return;
    }
    const entries = this.getMatches();
    const none = [t('No blocks match “{words}”', {words: query.trim()}), t('Try a simpler word, such as “turn” or “say”,'),
      t('or browse the categories.')].map((text) => ({kind: 'label', text, gap: 8}));
    const {atFirst} = this;
    const number = entries.length - atFirst;
    const more = {kind: 'button', text: t('Show {number} more', {number}), callbackkey: SHOW_ALL};
    this.toolbox.showFound(!entries.length ? none : number > 0 ? [...entries.slice(0, atFirst), more] : entries);
  }

  private onKey(event: KeyboardEvent): void {
    event.stopPropagation();
    if (event.key === 'Escape') {
      this.clear();
      this.toolbox.showFound(null);
      Blockly.getFocusManager().focusTree(this.parentToolbox_.getWorkspace());
    } else if (event.key === 'Enter' || event.key === 'ArrowDown') {
      this.flushSearch();
      this.toolbox.enterFound(event.key === 'Enter' ? event : null);
    } else {
      if (event.key === 'Tab') this.flushSearch();
      if (event.key === 'Tab' && event.shiftKey) this.focusPrevious();
      return;
    }
    event.preventDefault();
  }

  /** Keeps Shift+Tab from focusing the toolbox, which would select a category and return the focus here. */
  private focusPrevious(): void {
    const box = this.div.closest<HTMLElement>('.blocklyToolbox');
    if (!box) return;
    box.tabIndex = -1;
    window.setTimeout(() => {
      box.tabIndex = 0;
    });
  }
}

Blockly.registry.register(Blockly.registry.Type.TOOLBOX_ITEM, SEARCH, SearchItem, true);
