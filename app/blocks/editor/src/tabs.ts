// The behaviours that are open in the page, one of them shown.
import * as Blockly from 'blockly/core';
import {type BlockDefinition, define, defineSources} from './definitions';
import {type Option} from './choices';
import {type BlockHelp, useHelp} from './help';
import {Tab, type TabListener} from './tab';

const BUSY_MS = 60;
/** A canvas as wide as this has room for the blocks of a category beside it. */
const WIDE = 1000;

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
  shown: Tab;
  private waiting: Definitions | null = null;
  private toolbox: unknown = {contents: []};
  /** Whether the blocks of a category stay open; null: when there is room. */
  private pinned: boolean | null = null;

  constructor(private readonly place: HTMLElement, private readonly listener: TabListener) {
    this.shown = this.make();
  }

  show({key, generation, workspace}: ShownTab): void {
    this.applyWaiting();
    const tab = this.tabs.get(key) ?? this.free() ?? this.make();
    tab.key = key;
    this.tabs.set(key, tab);
    this.turnTo(tab);
    if (generation !== undefined) tab.load(generation, workspace ?? {});
  }

  close(key: string): void {
    const tab = this.tabs.get(key);
    if (!tab) return;
    this.tabs.delete(key);
    if (tab === this.shown) this.turnTo(this.make(), false);
    tab.dispose();
  }

  /** Keeps the blocks of a category open (true), or not; null: as long as the page is wide. */
  setPinned(pinned: boolean | null): void {
    this.pinned = pinned;
    this.shown.setPinned(this.staysOpen, pinned === null);
  }

  /** The page has another size. */
  resize(): void {
    this.shown.resize();
    if (this.pinned === null) this.shown.setPinned(this.staysOpen, true);
  }

  private get staysOpen(): boolean {
    const toolbox = this.shown.workspace.getMetricsManager().getToolboxMetrics().width;
    return this.pinned ?? this.place.clientWidth - toolbox >= WIDE;
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

  private make(): Tab {
    const tab = new Tab(this.place, this.listener);
    tab.definitionsChanged([], this.toolbox, false);
    return tab;
  }

  private free(): Tab | null {
    return this.tabs.has(this.shown.key) ? null : this.shown;
  }

  private turnTo(tab: Tab, keeps = true): void {
    const before = this.shown;
    if (tab === before) return;
    const hadFocus = before.hasFocus;
    if (keeps) before.hide();
    this.shown = tab;
    tab.show();
    tab.setPinned(this.staysOpen, true);
    if (hadFocus) tab.focus();
  }

  private all(): Set<Tab> {
    return new Set([...this.tabs.values(), this.shown]);
  }

  private applyWhenIdle(): void {
    const busy = Blockly.Gesture.inProgress() || this.shown.isDragging ||
      Blockly.WidgetDiv.isVisible() || Blockly.DropDownDiv.isVisible() ||
      document.querySelector('dialog[open]') !== null;
    if (busy && this.waiting) window.setTimeout(() => this.applyWhenIdle(), BUSY_MS);
    else this.applyWaiting();
  }

  private applyWaiting(): void {
    const definitions = this.waiting;
    this.waiting = null;
    if (!definitions) return;
    useHelp(definitions.help ?? {});
    const {changed, sources} = define(definitions.blocks ?? []);
    const topics = (definitions.topics ?? []).map((each): Option => [each, each]);
    const more = defineSources({topics, ...definitions.sources});
    this.toolbox = {contents: [], ...definitions.toolbox};
    for (const tab of this.all()) tab.definitionsChanged(changed, this.toolbox, sources || more);
  }
}
