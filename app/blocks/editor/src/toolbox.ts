// Toolbox with icon tiles, headings and robots.
import * as Blockly from 'blockly/core';
import {Flyout} from './flyout';
import {focusedBlock} from './help';
import {iconElement, iconName} from './icons';
import type {RobotAlarm} from './messages';
import {SEARCH, SearchItem} from './search_item';
import {t} from './words';

type Def = Record<string, unknown>;

function toText(value: unknown): string {
  return typeof value === 'string' ? value : '';
}

class Category extends Blockly.ToolboxCategory {
  protected override createIconDom_(): Element {
    const def = this.toolboxItemDef_ as unknown as Def;
    const tile = document.createElement('span');
    tile.className = 'nepTile';
    tile.style.background = this.colour_;
    tile.append(iconElement(iconName(toText(def['icon']), toText(def['categorystyle'])), 16));
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

function connectionNote(def: Def): string {
  if (def['connected'] === false) return t('not connected');
  return def['virtual'] === true ? t('virtual') : '';
}

let alarms = new Map<string, RobotAlarm>();
const headings = new Set<Heading>();

/** Shows the alarms in the robots' headings immediately, even during a drag: a stale green dot would mislead. */
export function showAlarms(now: Record<string, RobotAlarm>): void {
  alarms = new Map(Object.entries(now));
  for (const heading of headings) heading.updateStatus();
}

/** Heading: "Blocks", or a robot's name with a filled dot (connected) or an empty ring (not connected). */
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
    name.textContent = toText(def['name']) || toText(def['text']);
    if (typeof def['connected'] === 'boolean') {
      div.append(this.dot);
      div.classList.add('robot');
    }
    div.append(name, this.note);
    this.div = div;
    headings.add(this);
    this.updateStatus();
  }

  /** Updates the dot and note: the alarm if there is one, else the connection. */
  updateStatus(): void {
    const def = (this.toolboxItemDef_ ?? {}) as unknown as Def;
    const alarm = typeof def['connected'] === 'boolean' ? alarms.get(toText(def['name'])) : undefined;
    this.dot.className = alarm?.status ?? (def['connected'] ? 'on' : 'off');
    this.note.className = alarm?.status ?? '';
    this.note.textContent = alarm?.text ?? (toText(def['note']) || connectionNote(def));
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

interface ToolboxContents {
  contents: Def[];
}

/** Gives every category a stable id; adds the search field and, without robots, a placeholder heading. */
function withIds(def: ToolboxContents): ToolboxContents {
  let section = '';
  const empty = def.contents.length && !def.contents.some((item) => item['kind'] === 'robotHeading');
  const none = {kind: 'robotHeading', name: t('No robot'), note: t('connected'), connected: false};
  const contents = def.contents.map((item) => {
    const name = toText(item['name']) || toText(item['text']);
    if (item['kind'] !== 'category') {
      section = name || section;
      return item;
    }
    const dynamic = toText(item['dynamic']);
    return {...item, ...(dynamic && {custom: dynamic}), toolboxitemid: toText(item['toolboxitemid']) || `category ${section} / ${name}`};
  });
  const search = {kind: SEARCH, toolboxitemid: 'search'};
  return {...def, contents: [search, ...contents, ...(empty ? [none] : [])]};
}

export class Toolbox extends Blockly.Toolbox {
  private contentsJson = '';
  private lastOpen = '';
  private isShowingResults = false;
  /** JSON of each category's original contents; Blockly modifies the contents that it receives. */
  private contentsById = new Map<string, string>();
  private contentItems: Def[] = [];
  /** Called when search results replace the contents of the flyout. */
  onResultsShown = (): void => undefined;

  /** Returns every block of every category, without duplicates. */
  allEntries(): Def[] {
    const seenKeys = new Set<string>();
    const offered = this.contentItems.flatMap((item) => {
      const dynamic = toText(item['dynamic']);
      const dynamicContents = dynamic && this.workspace_.getToolboxCategoryCallback(dynamic)?.(this.workspace_);
      return (Array.isArray(dynamicContents) ? dynamicContents : item['contents'] ?? []) as Def[];
    });
    return offered.filter((entry) => {
      const key = JSON.stringify(entry);
      if (entry['kind'] !== 'block' || seenKeys.has(key)) return false;
      return seenKeys.add(key);
    });
  }

  /** True if the flyout stays open. */
  private get isPinned(): boolean {
    const flyout = this.getFlyout();
    return flyout instanceof Flyout && flyout.isPinned;
  }

  /** Pins or unpins the flyout; `shouldClose`: unpinning also shouldClose it. */
  setPinned(isPinned: boolean, shouldClose: boolean): void {
    const flyout = this.getFlyout();
    if (!(flyout instanceof Flyout)) return;
    const before = flyout.isPinned;
    flyout.setPinned(isPinned);
    if (isPinned) this.openLastCategory();
    else if (before && shouldClose) this.clearSelection();
    if (before !== isPinned) this.workspace_.resize();
  }

  /** Opens the last or first category if the flyout is pinned and closed. */
  private openLastCategory(): void {
    if (!this.isPinned || this.getFlyout()?.isVisible()) return;
    const items = this.getToolboxItems().filter((item) => item.isSelectable());
    const last = items.find((item) => item.getId() === this.lastOpen);
    const item = last ?? items[0];
    if (item) this.setSelectedItem(item);
  }

  /** Keeps the selection while the flyout is pinned; only another category replaces it. */
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
    this.isShowingResults = false;
    this.setTitle(item.getName());
  }

  private setTitle(title: string): void {
    const flyout = this.getFlyout();
    if (flyout instanceof Flyout) flyout.setTitle(title);
  }

  /** Shows search results in the flyout; null ends the search and reopens a pinned category. */
  showFound(entries: unknown[] | null): void {
    if (this.selectedItem_) this.deselectItem_(this.selectedItem_);
    const flyout = this.getFlyout();
    this.setTitle(t('Search results'));
    if (entries) flyout?.show(entries as Blockly.utils.toolbox.FlyoutItemInfoArray);
    else flyout?.hide();
    this.openLastCategory();
    this.isShowingResults = entries !== null;
    this.onResultsShown();
  }

  /** Shows all results; with keyboard navigation, focuses the first one that was hidden before. */
  showAllFound(entries: unknown[], before: number): void {
    const flyout = this.getFlyout();
    const scroll = flyout?.getWorkspace().scrollY ?? 0;
    this.showFound(entries);
    flyout?.getWorkspace().scrollbar?.setY(-scroll);
    const next = flyout?.getWorkspace().getTopBlocks(true)[before];
    if (next && Blockly.keyboardNavigationController.getIsActive()) Blockly.getFocusManager().focusNode(next);
  }

  /** Focuses the first result; with a key event, also picks it and ends the search. */
  enterFound(event: KeyboardEvent | null): void {
    const workspace = this.getFlyout()?.getWorkspace();
    const first = this.isShowingResults && this.getFlyout()?.isVisible() ? workspace?.getTopBlocks(true)[0] : undefined;
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

  /** Focuses the search field. */
  focusSearch(): void {
    for (const item of this.getToolboxItems()) if (item instanceof SearchItem) item.focus();
  }

  /** Returns the static contents of a dynamic category. */
  contentsOf(dynamic: string): unknown[] {
    return this.contentItems.find((item) => item['dynamic'] === dynamic)?.['contents'] as unknown[] ?? [];
  }

  /** Opens a dynamic category, or refreshes it if it is open. */
  openDynamic(dynamic: string): void {
    const id = this.contentItems.find((item) => item['dynamic'] === dynamic)?.['toolboxitemid'];
    const item = this.getToolboxItems().find((candidate) => candidate.getId() === id);
    if (item && item === this.selectedItem_) this.refreshSelection();
    else if (item) this.setSelectedItem(item);
  }

  /** Refreshes a dynamic category if it is open. */
  refreshDynamic(dynamic: string): void {
    const open = this.selectedItem_;
    if (open && this.contentItems.some((item) => item['dynamic'] === dynamic && item['toolboxitemid'] === open.getId())) {
      const scroll = this.getFlyout()?.getWorkspace().scrollY ?? 0;
      this.refreshSelection();
      this.getFlyout()?.getWorkspace().scrollbar?.setY(-scroll);
    }
  }

  /** Replaces the contents; keeps the open category, search text and focus. Does nothing if nothing changed. */
  update(def: unknown, haveBlocksChanged: boolean): void {
    const items = withIds(def as ToolboxContents);
    const key = JSON.stringify(items);
    const hasSameItems = key === this.contentsJson;
    if (hasSameItems && !haveBlocksChanged) return;
    this.contentsJson = key;
    const restoreFocus = this.captureFocus();
    const query = hasSameItems ? undefined : this.searchItem?.query;
    const {isShowingResults: showsFound} = this;
    this.showContents(items, hasSameItems, haveBlocksChanged);
    if (query) this.searchItem?.restore(query);
    if (showsFound) this.searchItem?.refresh();
    restoreFocus();
  }

  private showContents(items: ToolboxContents, hasSameItems: boolean, haveBlocksChanged: boolean): void {
    const flyout = this.getFlyout();
    const open = this.selectedItem_;
    const before = this.contentsById;
    this.contentItems = items.contents;
    this.contentsById = new Map(items.contents.map((item) => [toText(item['toolboxitemid']), JSON.stringify(item['contents'])]));
    const scroll = flyout?.getWorkspace().scrollY ?? 0;
    if (!hasSameItems) {
      this.selectedItem_ = null;
      this.render(items as unknown as Blockly.utils.toolbox.ToolboxInfo);
    }
    if (!open) {
      this.openLastCategory();
      return;
    }
    const newItem = this.getToolboxItemById(open.getId());
    if (!newItem?.isSelectable()) {
      this.selectedItem_ = null;
      flyout?.hide();
      this.openLastCategory();
      return;
    }
    const item = newItem as Blockly.ISelectableToolboxItem;
    if (!hasSameItems) this.selectItem_(null, item);
    if (!haveBlocksChanged && before.get(item.getId()) === this.contentsById.get(item.getId())) return;
    flyout?.show(item.getContents());
    const workspace = flyout?.getWorkspace();
    workspace?.scrollbar?.setY(-scroll);
  }

  private get searchItem(): SearchItem | undefined {
    return this.getToolboxItems().find((item) => item instanceof SearchItem);
  }

  /** Returns a function that restores the focus after the contents were replaced. */
  private captureFocus(): () => void {
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
      const block = tops.find((top) => contentOf(top) === content) ?? tops[0];
      if (block) manager.focusNode(block);
      else manager.focusTree(this);
    };
  }
}

Blockly.registry.register(Blockly.registry.Type.TOOLBOX_ITEM, 'category', Category, true);
for (const kind of ['heading', 'blocksHeading', 'robotHeading']) {
  Blockly.registry.register(Blockly.registry.Type.TOOLBOX_ITEM, kind, Heading, true);
}
