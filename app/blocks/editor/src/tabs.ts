// The behaviours that are open in the page, one of them shown.
import * as Blockly from 'blockly/core';
import {type BlockDefinition, defineBlocks, defineSources} from './definitions';
import {type Option} from './choices';
import {type BlockHelp, setHelp} from './help';
import {Tab, type TabListener} from './tab';

const BUSY_POLL_MS = 60;
/** A canvas as wide as this has room for the blocks of a category beside it. */
const MIN_PINNED_WIDTH = 1000;

export interface Definitions {
  blocks?: BlockDefinition[];
  toolbox?: {contents?: unknown[]};
  topics?: string[];
  help?: Record<string, BlockHelp>;
  sources?: Record<string, Option[]>;
}

export interface ShownTab {
  key: string;
  /** With a program: load it here. Without: show what is here already. */
  generation?: number;
  workspace?: Record<string, unknown>;
}

export class Tabs {
  private readonly tabs = new Map<string, Tab>();
  /** The one that is shown; before the first key, and after closing it, an empty one without a key. */
  activeTab: Tab;
  private waiting: Definitions | null = null;
  private toolbox: unknown = {contents: []};
  /** Whether the blocks of a category stay open; null: when there is room. */
  private pinned: boolean | null = null;

  constructor(private readonly container: HTMLElement, private readonly listener: TabListener) {
    this.activeTab = this.createTab();
  }

  show({key, generation, workspace}: ShownTab): void {
    this.applyPending();
    const tab = this.tabs.get(key) ?? this.getUnusedTab() ?? this.createTab();
    tab.key = key;
    this.tabs.set(key, tab);
    this.activate(tab);
    if (generation !== undefined) tab.load(generation, workspace ?? {});
  }

  close(key: string): void {
    const tab = this.tabs.get(key);
    if (!tab) return;
    this.tabs.delete(key);
    if (tab === this.activeTab) this.activate(this.createTab(), false);
    tab.dispose();
  }

  /** Keeps the blocks of a category open (true), or not; null: as long as the page is wide. */
  setPinned(pinned: boolean | null): void {
    this.pinned = pinned;
    this.activeTab.setPinned(this.staysOpen, pinned === null);
  }

  /** The page has another size. */
  resize(): void {
    this.activeTab.resize();
    if (this.pinned === null) this.activeTab.setPinned(this.staysOpen, true);
  }

  private get staysOpen(): boolean {
    const toolbox = this.activeTab.workspace.getMetricsManager().getToolboxMetrics().width;
    return this.pinned ?? this.container.clientWidth - toolbox >= MIN_PINNED_WIDTH;
  }

  themeChanged(): void {
    for (const tab of this.all()) tab.themeChanged();
  }

  /** Waits while a block is in the hand or a field is open: nobody's drag is broken by a robot that connects. */
  define(definitions: Definitions): void {
    const first = this.waiting === null;
    this.waiting = definitions;
    if (first) this.applyWhenIdle();
  }

  private createTab(): Tab {
    const tab = new Tab(this.container, this.listener);
    tab.definitionsChanged([], this.toolbox, false);
    return tab;
  }

  private getUnusedTab(): Tab | null {
    return this.tabs.has(this.activeTab.key) ? null : this.activeTab;
  }

  private activate(tab: Tab, keeps = true): void {
    const before = this.activeTab;
    if (tab === before) return;
    const hadFocus = before.hasFocus;
    if (keeps) before.hide();
    this.activeTab = tab;
    tab.show();
    tab.setPinned(this.staysOpen, true);
    if (hadFocus) tab.focus();
  }

  private all(): Set<Tab> {
    return new Set([...this.tabs.values(), this.activeTab]);
  }

  private applyWhenIdle(): void {
    const busy = Blockly.Gesture.inProgress() || this.activeTab.isDragging ||
      Blockly.WidgetDiv.isVisible() || Blockly.DropDownDiv.isVisible() ||
      document.querySelector('dialog[open]') !== null;
    if (busy && this.waiting) window.setTimeout(() => this.applyWhenIdle(), BUSY_POLL_MS);
    else this.applyPending();
  }

  private applyPending(): void {
    const definitions = this.waiting;
    this.waiting = null;
    if (!definitions) return;
    setHelp(definitions.help ?? {});
    const {changed, sources} = defineBlocks(definitions.blocks ?? []);
    const topics = (definitions.topics ?? []).map((topic): Option => [topic, topic]);
    const more = defineSources({topics, ...definitions.sources});
    this.toolbox = {contents: [], ...definitions.toolbox};
    for (const tab of this.all()) tab.definitionsChanged(changed, this.toolbox, sources || more);
  }
}
