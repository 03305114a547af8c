// The toolbox of the design: tiles with icons, headings, robots.
import * as Blockly from 'blockly/core';
import {Flyout} from './flyout';
import {focusedBlock} from './help';
import {iconElement, iconName} from './icons';
import {SEARCH, SearchItem} from './search_item';
import {t} from './words';

type Def = Record<string, unknown>;

function text(value: unknown): string {
  return typeof value === 'string' ? value : '';
}

class Category extends Blockly.ToolboxCategory {
  protected override createIconDom_(): Element {
    const def = this.toolboxItemDef_ as unknown as Def;
    const tile = document.createElement('span');
    tile.className = 'nepTile';
    tile.style.background = this.colour_;
    tile.append(iconElement(iconName(text(def['icon']), text(def['categorystyle'])), 16));
    return tile;
  }

  protected override addColourBorder_(colour: string): void {
    const tile = this.iconDom_;
    if (tile instanceof HTMLElement) tile.style.background = colour;
  }

  override setSelected(isSelected: boolean): void {
    super.setSelected(isSelected);
    if (this.rowDiv_) this.rowDiv_.style.backgroundColor = '';
  }
}

function noteOf(def: Def): string {
  if (def['connected'] === false) return t('not connected');
  return def['virtual'] === true ? t('virtual') : '';
}

/** What is wrong with a robot now: a status of the design (its dot has that colour), and the words for it. */
export interface Alarm {
  status: string;
  words: string;
}

let alarms = new Map<string, Alarm>();
const headings = new Set<Heading>();

/** The headings of these robots say so, at once and whatever is in the hand: a dot must not stay green. */
export function showAlarms(now: Record<string, Alarm>): void {
  alarms = new Map(Object.entries(now));
  for (const heading of headings) heading.dress();
}

/** "Blocks", or a robot's name with a filled dot (connected) or an empty ring (not). */
class Heading extends Blockly.ToolboxItem {
  private div: HTMLDivElement | null = null;
  private readonly dot = document.createElement('i');
  private readonly note = document.createElement('span');

  override init(): void {
    const def = (this.toolboxItemDef_ ?? {}) as unknown as Def;
    const div = document.createElement('div');
    div.className = 'nepHeading';
    div.id = this.getId();
    div.setAttribute('role', 'presentation');
    const name = document.createElement('b');
    name.textContent = text(def['name']) || text(def['text']);
    if (typeof def['connected'] === 'boolean') {
      div.append(this.dot);
      div.classList.add('robot');
    }
    div.append(name, this.note);
    this.div = div;
    headings.add(this);
    this.dress();
  }

  /** Dot and note: what is wrong now, else whether the robot is connected. */
  dress(): void {
    const def = (this.toolboxItemDef_ ?? {}) as unknown as Def;
    const alarm = typeof def['connected'] === 'boolean' ? alarms.get(text(def['name'])) : undefined;
    this.dot.className = alarm?.status ?? (def['connected'] ? 'on' : 'off');
    this.note.className = alarm?.status ?? '';
    this.note.textContent = alarm?.words ?? (text(def['note']) || noteOf(def));
  }

  override getDiv(): Element | null {
    return this.div;
  }

  override canBeFocused(): boolean {
    return false;
  }

  override dispose(): void {
    headings.delete(this);
    this.div?.remove();
  }
}

interface Items {
  contents: Def[];
}

/** Gives every item an id that stays the same from one definition to the next; says so when there is no robot. */
function withIds(def: Items): Items {
  let section = '';
  const empty = def.contents.length && !def.contents.some((item) => item['kind'] === 'robotHeading');
  const none = {kind: 'robotHeading', name: t('No robot'), note: t('connected'), connected: false};
  const contents = def.contents.map((item) => {
    const name = text(item['name']) || text(item['text']);
    if (item['kind'] !== 'category') {
      section = name || section;
      return item;
    }
    const dynamic = text(item['dynamic']);
    return {...item, ...(dynamic && {custom: dynamic}), toolboxitemid: text(item['toolboxitemid']) || `category ${section} / ${name}`};
  });
  const search = {kind: SEARCH, toolboxitemid: 'search'};
  return {...def, contents: [search, ...contents, ...(empty ? [none] : [])]};
}

export class Toolbox extends Blockly.Toolbox {
  private shown = '';
  private lastOpen = '';
  private showsFound = false;
  /** What each category was made of; Blockly writes into the contents it is given. */
  private made = new Map<string, string>();
  private given: Def[] = [];
  /** What to do when other blocks are shown than those of a category. */
  onFound = (): void => undefined;

  /** Every block of every category, each once. */
  allEntries(): Def[] {
    const seen = new Set<string>();
    const offered = this.given.flatMap((item) => {
      const dynamic = text(item['dynamic']);
      const made = dynamic && this.workspace_.getToolboxCategoryCallback(dynamic)?.(this.workspace_);
      return (Array.isArray(made) ? made : item['contents'] ?? []) as Def[];
    });
    return offered.filter((each) => {
      const key = JSON.stringify(each);
      if (each['kind'] !== 'block' || seen.has(key)) return false;
      return seen.add(key);
    });
  }

  /** Whether a category stays open. */
  private get isPinned(): boolean {
    const flyout = this.getFlyout();
    return flyout instanceof Flyout && flyout.isPinned;
  }

  /** Keeps a category open from now on, or lets it close; `closes`: at once. */
  setPinned(keeps: boolean, closes: boolean): void {
    const flyout = this.getFlyout();
    if (!(flyout instanceof Flyout)) return;
    const before = flyout.isPinned;
    flyout.setPinned(keeps);
    if (keeps) this.openLast();
    else if (before && closes) this.clearSelection();
    if (before !== keeps) this.workspace_.resize();
  }

  /** Opens the category that was open last, or the first, when none is open and one has to be. */
  private openLast(): void {
    if (!this.isPinned || this.getFlyout()?.isVisible()) return;
    const items = this.getToolboxItems().filter((item) => item.isSelectable());
    const last = items.find((item) => item.getId() === this.lastOpen);
    const item = last ?? items[0];
    if (item) this.setSelectedItem(item);
  }

  /** A category that stays open is left only for another. */
  override clearSelection(): void {
    if (!this.isPinned) super.clearSelection();
  }

  override autoHide(onlyClosePopups: boolean): void {
    const flyout = this.getFlyout();
    if (!(flyout instanceof Flyout && flyout.hasFocus)) super.autoHide(onlyClosePopups);
  }

  protected override selectItem_(before: Blockly.ISelectableToolboxItem | null, item: Blockly.ISelectableToolboxItem): void {
    super.selectItem_(before, item);
    this.lastOpen = item.getId();
    this.showsFound = false;
    this.setTitle(item.getName());
  }

  private setTitle(words: string): void {
    const flyout = this.getFlyout();
    if (flyout instanceof Flyout) flyout.setTitle(words);
  }

  /** Shows these blocks in place of a category; null shows the category again, or none. */
  showFound(entries: unknown[] | null): void {
    if (this.selectedItem_) this.deselectItem_(this.selectedItem_);
    const flyout = this.getFlyout();
    this.setTitle(t('Search results'));
    if (entries) flyout?.show(entries as Blockly.utils.toolbox.FlyoutItemInfoArray);
    else flyout?.hide();
    this.openLast();
    this.showsFound = entries !== null;
    this.onFound();
  }

  /** Shows also those that were found and not shown; with the keys one is on the first of them. */
  showAllFound(entries: unknown[], before: number): void {
    const flyout = this.getFlyout();
    const scroll = flyout?.getWorkspace().scrollY ?? 0;
    this.showFound(entries);
    flyout?.getWorkspace().scrollbar?.setY(-scroll);
    const next = flyout?.getWorkspace().getTopBlocks(true)[before];
    if (next && Blockly.keyboardNavigationController.getIsActive()) Blockly.getFocusManager().focusNode(next);
  }

  /** The keys go to the first block that was found; with a key press it is taken at once. */
  enterFound(event: KeyboardEvent | null): void {
    const workspace = this.getFlyout()?.getWorkspace();
    const first = this.showsFound && this.getFlyout()?.isVisible() ? workspace?.getTopBlocks(true)[0] : undefined;
    Blockly.keyboardNavigationController.setIsActive(true);
    if (!first) {
      Blockly.getFocusManager().focusTree(this);
      return;
    }
    Blockly.getFocusManager().focusNode(first);
    if (!event) return;
    first.performAction(event);
    this.showFound(null);
    for (const item of this.getToolboxItems()) if (item instanceof SearchItem) item.clear();
  }

  /** The keys go to the field that finds blocks. */
  focusSearch(): void {
    for (const item of this.getToolboxItems()) if (item instanceof SearchItem) item.focus();
  }

  /** What a category holds beside what people made themselves. */
  contentsOf(dynamic: string): unknown[] {
    return this.given.find((item) => item['dynamic'] === dynamic)?.['contents'] as unknown[] ?? [];
  }

  /** Opens a category of what people made, also again with what is new in it. */
  openDynamic(dynamic: string): void {
    const id = this.given.find((item) => item['dynamic'] === dynamic)?.['toolboxitemid'];
    const item = this.getToolboxItems().find((each) => each.getId() === id);
    if (item && item === this.selectedItem_) this.refreshSelection();
    else if (item) this.setSelectedItem(item);
  }

  /** Shows a category of what people made again, if it is open. */
  refreshDynamic(dynamic: string): void {
    const open = this.selectedItem_;
    if (open && this.given.some((item) => item['dynamic'] === dynamic && item['toolboxitemid'] === open.getId())) {
      const scroll = this.getFlyout()?.getWorkspace().scrollY ?? 0;
      this.refreshSelection();
      this.getFlyout()?.getWorkspace().scrollbar?.setY(-scroll);
    }
  }

  /** Shows new contents; an open category, typed words and the focus stay, and equal contents change nothing. */
  update(def: unknown, blocksChanged: boolean): void {
    const items = withIds(def as Items);
    const key = JSON.stringify(items);
    const sameItems = key === this.shown;
    if (sameItems && !blocksChanged) return;
    this.shown = key;
    const restoreFocus = this.rememberFocus();
    const query = sameItems ? undefined : this.searchItem?.query;
    const {showsFound} = this;
    this.showContents(items, sameItems, blocksChanged);
    if (query) this.searchItem?.restore(query);
    if (showsFound) this.searchItem?.refresh();
    restoreFocus();
  }

  private showContents(items: Items, sameItems: boolean, blocksChanged: boolean): void {
    const flyout = this.getFlyout();
    const open = this.selectedItem_;
    const before = this.made;
    this.given = items.contents;
    this.made = new Map(items.contents.map((item) => [text(item['toolboxitemid']), JSON.stringify(item['contents'])]));
    const scroll = flyout?.getWorkspace().scrollY ?? 0;
    if (!sameItems) {
      this.selectedItem_ = null;
      this.render(items as unknown as Blockly.utils.toolbox.ToolboxInfo);
    }
    if (!open) {
      this.openLast();
      return;
    }
    const again = this.getToolboxItemById(open.getId());
    if (!again?.isSelectable()) {
      this.selectedItem_ = null;
      flyout?.hide();
      this.openLast();
      return;
    }
    const item = again as Blockly.ISelectableToolboxItem;
    if (!sameItems) this.selectItem_(null, item);
    if (!blocksChanged && before.get(item.getId()) === this.made.get(item.getId())) return;
    flyout?.show(item.getContents());
    const workspace = flyout?.getWorkspace();
    workspace?.scrollbar?.setY(-scroll);
  }

  private get searchItem(): SearchItem | undefined {
    return this.getToolboxItems().find((item) => item instanceof SearchItem);
  }

  /** Returns a function that restores the focus after the contents were replaced. */
  private rememberFocus(): () => void {
    const manager = Blockly.getFocusManager();
    const node = manager.getFocusedNode();
    const blocks = this.getFlyout()?.getWorkspace();
    if (!node || !blocks || !document.hasFocus()) return () => undefined;
    if (node.getFocusableTree() === this) {
      const id = node instanceof Blockly.ToolboxItem ? node.getId() : '';
      return () => {
        const item = this.getToolboxItemById(id);
        if (item?.canBeFocused()) manager.focusNode(item);
        else manager.focusTree(this);
      };
    }
    if (node.getFocusableTree() !== blocks) return () => undefined;
    const contentOf = (block: Blockly.Block): string =>
      JSON.stringify(Blockly.serialization.blocks.save(block, {saveIds: false}));
    const root = focusedBlock()?.getRootBlock();
    const content = root && contentOf(root);
    return () => {
      const tops = blocks.getTopBlocks(true);
      if (root && tops.includes(root)) return;
      const block = tops.find((each) => contentOf(each) === content) ?? tops[0];
      if (block) manager.focusNode(block);
      else manager.focusTree(this);
    };
  }
}

Blockly.registry.register(Blockly.registry.Type.TOOLBOX_ITEM, 'category', Category, true);
for (const kind of ['heading', 'blocksHeading', 'robotHeading']) {
  Blockly.registry.register(Blockly.registry.Type.TOOLBOX_ITEM, kind, Heading, true);
}
