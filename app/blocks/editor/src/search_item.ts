// The field above the toolbox: type, see the blocks that answer, take one with Enter.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {type Entry, findEntries} from './search';
import {t} from './words';

export const SEARCH = 'nepSearch';

/** What the field needs of the toolbox in which it stands. */
interface SearchedToolbox {
  allEntries(): Entry[];
  showFound(entries: unknown[] | null): void;
  enterFound(event: KeyboardEvent | null): void;
}

export class SearchItem extends Blockly.ToolboxItem {
  private readonly div = document.createElement('div');
  private readonly field = document.createElement('input');

  override init(): void {
    this.div.className = 'nepSearch';
    this.div.setAttribute('role', 'search');
    this.field.type = 'search';
    this.field.placeholder = t('Find a block');
    this.field.spellcheck = false;
    this.field.setAttribute('aria-label', t('Find a block: type words, Enter takes the first'));
    this.field.title = t('Find a block');
    this.field.onfocus = this.field.onblur = () => this.dress();
    this.field.oninput = () => this.show();
    this.field.onkeydown = (event) => this.onKey(event);
    // Otherwise the toolbox takes it for a click beside its categories and closes the blocks.
    this.div.onpointerdown = (event) => event.stopPropagation();
    this.div.append(iconElement('search', 16), this.field);
  }

  override getDiv(): Element {
    return this.div;
  }

  override canBeFocused(): boolean {
    return false;
  }

  override dispose(): void {
    this.div.remove();
  }

  focus(): void {
    this.field.focus();
    this.field.select();
    if (this.field.value) this.show();
  }

  clear(): void {
    this.field.value = '';
    this.dress();
  }

  /** While somebody looks for a block, a toolbox of tiles is whole. */
  private dress(): void {
    const whole = document.activeElement === this.field || this.field.value !== '';
    const box = this.div.closest('.blocklyToolbox');
    if (!box || box.classList.contains('nepWhole') === whole) return;
    box.classList.toggle('nepWhole', whole);
    const workspace = this.parentToolbox_.getWorkspace();
    if (workspace.getParentSvg().isConnected) Blockly.svgResize(workspace);
  }

  private get toolbox(): SearchedToolbox {
    return this.parentToolbox_ as unknown as SearchedToolbox;
  }

  private show(): void {
    const words = this.field.value;
    if (!words.trim()) {
      this.toolbox.showFound(null);
      return;
    }
    const found = findEntries(this.toolbox.allEntries(), words);
    const none = [t('No block for “{words}”', {words: words.trim()}), t('Try a simpler word, such as “turn” or “say”,'),
      t('or look into a category.')].map((text) => ({kind: 'label', text, gap: 8}));
    this.toolbox.showFound(found.length ? found : none);
  }

  private onKey(event: KeyboardEvent): void {
    event.stopPropagation();
    if (event.key === 'Escape') {
      this.clear();
      this.toolbox.showFound(null);
      Blockly.getFocusManager().focusTree(this.parentToolbox_.getWorkspace());
    } else if (event.key === 'Enter' || event.key === 'ArrowDown') {
      this.toolbox.enterFound(event.key === 'Enter' ? event : null);
    } else {
      if (event.key === 'Tab' && event.shiftKey) this.leaveBackwards();
      return;
    }
    event.preventDefault();
  }

  /** The toolbox around the field would get the keys next and give them to a category, which leads back to here. */
  private leaveBackwards(): void {
    const box = this.div.closest<HTMLElement>('.blocklyToolbox');
    if (!box) return;
    box.tabIndex = -1;
    window.setTimeout(() => {
      box.tabIndex = 0;
    });
  }
}

Blockly.registry.register(Blockly.registry.Type.TOOLBOX_ITEM, SEARCH, SearchItem, true);
