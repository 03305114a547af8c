// Cards at the edge of the page that show the values of variables; movable, and saved with the behaviour.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import type {VariableValue} from './messages';
import {t} from './words';

const SERIALIZER_NAME = 'nepWatched';
const SERIALIZER_PRIORITY = 10;
const PAGE_MARGIN = 6;

interface Watched {
  id: string;
  /** Position chosen by the user: distances from the right and top edges, in pixels. */
  right?: number;
  top?: number;
}

interface Listener {
  /** The watched variables or the positions of their cards have changed. */
  changed(): void;
}

const instances = new WeakMap<Blockly.Workspace, WatchedValues>();

export class WatchedValues {
  private watched: Watched[] = [];
  private values: Record<string, VariableValue> = {};
  private readonly cards = new Map<string, HTMLElement>();
  private readonly column = document.createElement('div');

  constructor(private readonly workspace: Blockly.WorkspaceSvg, container: HTMLElement, private readonly listener: Listener) {
    this.column.className = 'nepWatched';
    container.append(this.column);
    instances.set(workspace, this);
    workspace.addChangeListener((event) => {
      const renamed = event.type === Blockly.Events.VAR_RENAME || event.type === Blockly.Events.VAR_DELETE ||
        event.type === Blockly.Events.VAR_CREATE;
      if (renamed && this.watched.length) this.render();
    });
  }

  get ids(): string[] {
    return this.watched.map(({id}) => id);
  }

  isWatched(id: string): boolean {
    return this.watched.some((item) => item.id === id);
  }

  toggle(id: string): void {
    this.watched = this.isWatched(id) ? this.watched.filter((item) => item.id !== id) : [...this.watched, {id}];
    this.render();
    this.listener.changed();
  }

  updateValues(values: Record<string, VariableValue>): void {
    const before = this.values;
    this.values = values;
    for (const [id, card] of this.cards) {
      if (JSON.stringify(before[id]) !== JSON.stringify(values[id])) this.renderValue(card, values[id]);
    }
  }

  save(): Watched[] | null {
    return this.watched.length ? this.watched : null;
  }

  load(saved: unknown): void {
    const entries = Array.isArray(saved) ? saved as Partial<Watched>[] : [];
    this.watched = entries.filter((entry): entry is Watched => typeof entry?.id === 'string');
    this.render();
  }

  /** Renders a card for each watched variable; deleted variables are skipped but kept, as undo may restore them. */
  private render(): void {
    this.column.replaceChildren();
    this.cards.clear();
    for (const watched of this.watched) {
      const variable = this.workspace.getVariableMap().getVariableById(watched.id);
      if (!variable) continue;
      const card = this.createCard(watched, variable.getName());
      this.cards.set(watched.id, card);
      this.column.append(card);
      this.renderValue(card, this.values[watched.id]);
    }
  }

  private createCard(watched: Watched, name: string): HTMLElement {
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
    this.positionCard(card, watched);
    card.onpointerdown = (event) => this.startDrag(card, watched, event);
    return card;
  }

  private renderValue(card: HTMLElement, value: VariableValue | undefined): void {
    const text = card.querySelector('b');
    const items = card.querySelector('ol');
    if (!text || !items) return;
    const isList = value?.kind === 'list';
    text.textContent = !value ? '–' : isList ? String(value.length) : value.text;
    text.title = value && !isList ? value.text : '';
    card.classList.toggle('list', isList);
    items.replaceChildren(...(isList ? value.items : []).map((itemText) => {
      const item = document.createElement('li');
      item.textContent = item.title = itemText;
      return item;
    }));
  }

  private positionCard(card: HTMLElement, {right, top}: Watched): void {
    const hasPosition = typeof right === 'number' && typeof top === 'number';
    card.classList.toggle('moved', hasPosition);
    card.style.right = hasPosition ? `max(${PAGE_MARGIN}px, min(${right}px, calc(100% - 80px)))` : '';
    card.style.top = hasPosition ? `max(${PAGE_MARGIN}px, min(${top}px, calc(100% - 40px)))` : '';
  }

  /** Moves the card with the pointer, within the page. */
  private startDrag(card: HTMLElement, watched: Watched, event: PointerEvent): void {
    if (event.button !== 0 || (event.target as Element).closest('button, ol')) return;
    event.preventDefault();
    const page = this.column.getBoundingClientRect();
    const box = card.getBoundingClientRect();
    const from = {x: event.clientX, y: event.clientY, right: page.right - box.right, top: box.top - page.top};
    let isMoved = false;
    card.setPointerCapture(event.pointerId);
    card.onpointermove = (now) => {
      isMoved ||= Math.hypot(now.clientX - from.x, now.clientY - from.y) > 3;
      if (!isMoved) return;
      const max = {right: page.width - box.width - PAGE_MARGIN, top: page.height - box.height - PAGE_MARGIN};
      watched.right = Math.round(Math.max(PAGE_MARGIN, Math.min(max.right, from.right - (now.clientX - from.x))));
      watched.top = Math.round(Math.max(PAGE_MARGIN, Math.min(max.top, from.top + now.clientY - from.y)));
      this.positionCard(card, watched);
    };
    card.onpointerup = card.onpointercancel = () => {
      card.onpointermove = card.onpointerup = card.onpointercancel = null;
      if (isMoved) this.listener.changed();
    };
  }
}

Blockly.serialization.registry.register(SERIALIZER_NAME, {
  priority: SERIALIZER_PRIORITY,
  save: (workspace) => instances.get(workspace)?.save() ?? null,
  load: (state, workspace) => instances.get(workspace)?.load(state),
  clear: (workspace) => instances.get(workspace)?.load([]),
});
