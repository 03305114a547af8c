// Manages the open tabs, one of which is shown.
import * as Blockly from 'blockly/core';
import {type BlockDefinition, defineBlocks, defineSources} from './definitions';
import {type Option} from './choices';
import {type BlockHelp, setHelp} from './help';
import type {ShowTab} from './messages';
import {Tab, type TabListener} from './tab';

const BUSY_POLL_MS = 60;
/** Minimum width in pixels of a canvas next to which the flyout stays open. */
const MIN_PINNED_WIDTH = 1000;

export interface Definitions {
  blocks?: BlockDefinition[];
  toolbox?: {contents?: unknown[]};
  topics?: string[];
  help?: Record<string, BlockHelp>;
  sources?: Record<string, Option[]>;
}

export class Tabs {
  private readonly tabs = new Map<string, Tab>();
  /** The visible tab; before the first `show` and after closing the visible tab, an empty tab without a key. */
  activeTab: Tab;
  private waiting: Definitions | null = null;
  private toolbox: unknown = {contents: []};
  /** True if the flyout is pinned, false if not; null: depends on the width of the page. */
  private isPinned: boolean | null = null;

  constructor(private readonly container: HTMLElement, private readonly listener: TabListener) {
    this.activeTab = this.createTab();
  }

  show({key, content}: ShowTab): void {
    this.applyPending();
    const tab = this.tabs.get(key) ?? this.getUnusedTab() ?? this.createTab();
    tab.key = key;
    this.tabs.set(key, tab);
    this.activate(tab);
    if (content) tab.load(content.generation, content.workspace);
  }

  close(key: string): void {
    const tab = this.tabs.get(key);
    if (!tab) return;
    this.tabs.delete(key);
    if (tab === this.activeTab) this.activate(this.createTab(), false);
    tab.dispose();
  }

  /** Pins (true) or unpins (false) the flyout; null: pinned while the page is wide enough. */
  setPinned(isPinned: boolean | null): void {
    this.isPinned = isPinned;
    this.activeTab.setPinned(this.staysOpen, isPinned === null);
  }

  /** Adapts the visible tab to the size of the page. */
  resize(): void {
    this.activeTab.resize();
    if (this.isPinned === null) this.activeTab.setPinned(this.staysOpen, true);
  }

  private get staysOpen(): boolean {
    const toolbox = this.activeTab.workspace.getMetricsManager().getToolboxMetrics().width;
    return this.isPinned ?? this.container.clientWidth - toolbox >= MIN_PINNED_WIDTH;
  }

  themeChanged(): void {
    for (const tab of this.all()) tab.themeChanged();
  }

  /** Applies definitions when idle, so that a connecting robot doesn't interrupt a drag or close an open field. */
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

  private activate(tab: Tab, isPreviousKept = true): void {
    const before = this.activeTab;
    if (tab === before) return;
    const hadFocus = before.hasFocus;
    if (isPreviousKept) before.hide();
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
    const {changed, haveSourcesChanged} = defineBlocks(definitions.blocks ?? []);
    const topics = (definitions.topics ?? []).map((topic): Option => [topic, topic]);
    const haveOptionsChanged = defineSources({topics, ...definitions.sources});
    this.toolbox = {contents: [], ...definitions.toolbox};
    for (const tab of this.all()) tab.definitionsChanged(changed, this.toolbox, haveSourcesChanged || haveOptionsChanged);
  }
}
