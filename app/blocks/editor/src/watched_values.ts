// What variables hold, on small cards at the edge of the page: kept with the behaviour, moved by hand.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {t} from './words';

const KEY = 'nepWatched';
const AFTER_THE_BLOCKS = 10;
const EDGE = 6;

/** As `VariableValue.to_json` tells it. */
export interface VariableValue {
  kind: string;
  text: string;
  items: string[];
  length: number;
}

interface Watched {
  id: string;
  /** Where a person put it, from the right and from the top. */
  right?: number;
  top?: number;
}

interface Listener {
  /** Something is watched that was not, or no longer, or elsewhere. */
  changed(): void;
}

const all = new WeakMap<Blockly.Workspace, WatchedValues>();

export class WatchedValues {
  private watched: Watched[] = [];
  private values: Record<string, VariableValue> = {};
  private readonly cards = new Map<string, HTMLElement>();
  private readonly column = document.createElement('div');

  constructor(private readonly workspace: Blockly.WorkspaceSvg, place: HTMLElement, private readonly listener: Listener) {
    this.column.className = 'nepWatched';
    place.append(this.column);
    all.set(workspace, this);
    workspace.addChangeListener((event) => {
      const renamed = event.type === Blockly.Events.VAR_RENAME || event.type === Blockly.Events.VAR_DELETE ||
        event.type === Blockly.Events.VAR_CREATE;
      if (renamed && this.watched.length) this.draw();
    });
  }

  get ids(): string[] {
    return this.watched.map(({id}) => id);
  }

  isWatched(id: string): boolean {
    return this.watched.some((each) => each.id === id);
  }

  toggle(id: string): void {
    this.watched = this.isWatched(id) ? this.watched.filter((each) => each.id !== id) : [...this.watched, {id}];
    this.draw();
    this.listener.changed();
  }

  show(values: Record<string, VariableValue>): void {
    const before = this.values;
    this.values = values;
    for (const [id, card] of this.cards) {
      if (JSON.stringify(before[id]) !== JSON.stringify(values[id])) this.fill(card, values[id]);
    }
  }

  save(): Watched[] | null {
    return this.watched.length ? this.watched : null;
  }

  load(saved: unknown): void {
    const given = Array.isArray(saved) ? saved as Partial<Watched>[] : [];
    this.watched = given.filter((each): each is Watched => typeof each?.id === 'string');
    this.draw();
  }

  /** A card for each watched variable; those whose variable is gone are not drawn, undo may bring it back. */
  private draw(): void {
    this.column.replaceChildren();
    this.cards.clear();
    for (const each of this.watched) {
      const variable = this.workspace.getVariableMap().getVariableById(each.id);
      if (!variable) continue;
      const card = this.card(each, variable.getName());
      this.cards.set(each.id, card);
      this.column.append(card);
      this.fill(card, this.values[each.id]);
    }
  }

  private card(watched: Watched, name: string): HTMLElement {
    const card = document.createElement('div');
    card.className = 'nepWatch';
    card.dataset['variable'] = watched.id;
    card.setAttribute('role', 'group');
    card.setAttribute('aria-label', name);
    const title = document.createElement('span');
    title.textContent = title.title = name;
    const close = document.createElement('button');
    close.type = 'button';
    close.title = t('Hide the value of “{name}”', {name});
    close.setAttribute('aria-label', close.title);
    close.append(iconElement('x', 14));
    close.onclick = () => this.toggle(watched.id);
    const value = document.createElement('b');
    const items = document.createElement('ol');
    card.append(title, value, close, items);
    this.move(card, watched);
    card.onpointerdown = (event) => this.drag(card, watched, event);
    return card;
  }

  private fill(card: HTMLElement, value: VariableValue | undefined): void {
    const words = card.querySelector('b');
    const items = card.querySelector('ol');
    if (!words || !items) return;
    const isList = value?.kind === 'list';
    words.textContent = !value ? '–' : isList ? String(value.length) : value.text;
    words.title = value && !isList ? value.text : '';
    card.classList.toggle('list', isList);
    items.replaceChildren(...(isList ? value.items : []).map((each) => {
      const item = document.createElement('li');
      item.textContent = item.title = each;
      return item;
    }));
  }

  private move(card: HTMLElement, {right, top}: Watched): void {
    const moved = typeof right === 'number' && typeof top === 'number';
    card.classList.toggle('moved', moved);
    card.style.right = moved ? `max(${EDGE}px, min(${right}px, calc(100% - 80px)))` : '';
    card.style.top = moved ? `max(${EDGE}px, min(${top}px, calc(100% - 40px)))` : '';
  }

  /** A card follows the hand; it stays inside the page. */
  private drag(card: HTMLElement, watched: Watched, event: PointerEvent): void {
    if (event.button !== 0 || (event.target as Element).closest('button, ol')) return;
    event.preventDefault();
    const page = this.column.getBoundingClientRect();
    const box = card.getBoundingClientRect();
    const from = {x: event.clientX, y: event.clientY, right: page.right - box.right, top: box.top - page.top};
    let moved = false;
    card.setPointerCapture(event.pointerId);
    card.onpointermove = (now) => {
      moved ||= Math.hypot(now.clientX - from.x, now.clientY - from.y) > 3;
      if (!moved) return;
      const most = {right: page.width - box.width - EDGE, top: page.height - box.height - EDGE};
      watched.right = Math.round(Math.max(EDGE, Math.min(most.right, from.right - (now.clientX - from.x))));
      watched.top = Math.round(Math.max(EDGE, Math.min(most.top, from.top + now.clientY - from.y)));
      this.move(card, watched);
    };
    card.onpointerup = card.onpointercancel = () => {
      card.onpointermove = card.onpointerup = card.onpointercancel = null;
      if (moved) this.listener.changed();
    };
  }
}

Blockly.serialization.registry.register(KEY, {
  priority: AFTER_THE_BLOCKS,
  save: (workspace) => all.get(workspace)?.save() ?? null,
  load: (state, workspace) => all.get(workspace)?.load(state),
  clear: (workspace) => all.get(workspace)?.load([]),
});
