// Blocks or a note carried out of the page: the window sees where they are, and may take them to another behaviour.
import * as Blockly from 'blockly/core';
import {countOf} from './bin';
import {removeAll} from './carry';
import {type Copied, type CopiedBlocks, add, copyOfAll, inOneStep, stateOf} from './clipboard';
import {inSight} from './free_place';
import type {Note} from './selection';
import type {Tab} from './tab';

type Point = Blockly.utils.Coordinate;

/** What is in the hand. It is where it was before once it is let go outside of the page. */
export interface Leaving {
  copied: Copied | CopiedBlocks;
  /** How it goes to another behaviour: what comes from the toolbox was never here. */
  how: 'moved' | 'copied' | 'added';
  /** The blocks at the top of what goes; none: it is a note. */
  heads: Blockly.BlockSvg[];
  place: Point;
  isGone(): boolean;
  /** Takes it away from where it is; its stack closes behind it. */
  remove(): void;
}

export interface CarryingWindow {
  /** Something in the hand is outside of the page there; not `out`: it is not any more. */
  carried(x: number, y: number, out: boolean): void;
  /** It was let go there. */
  dropped(x: number, y: number): void;
  /** So many blocks are in the behaviour that shows now; 0: it was a note. */
  brought(count: number, how: string): void;
}

interface Step {
  tab: Tab;
  group: string;
  /** The same without undo, when other edits came later. */
  otherwise(): void;
}

export function isOutside({x, y}: Point): boolean {
  return x < 0 || y < 0 || x >= window.innerWidth || y >= window.innerHeight;
}

/** What would leave the page with this; null: it stays. */
export function leaving(item: unknown, fromToolbox: boolean, copies: boolean): Leaving | null {
  const isOne = item instanceof Blockly.BlockSvg || item instanceof Blockly.comments.RenderedWorkspaceComment;
  const copied = isOne ? stateOf(item, true) : null;
  if (!isOne || !copied) return null;
  const block = item instanceof Blockly.BlockSvg ? item : null;
  const isAlone = !block?.getNextBlock();
  return {
    copied,
    how: fromToolbox ? 'added' : copies || !item.isDeletable() ? 'copied' : 'moved',
    heads: block ? [block] : [],
    place: item.getRelativeToSurfaceXY(),
    isGone: () => item.isDeadOrDying(),
    remove: () => block ? block.dispose(isAlone, false) : item.dispose(),
  };
}

/** The same of blocks and notes that were chosen together. */
export function leavingTogether(runs: readonly Blockly.BlockSvg[][], notes: readonly Note[], copies: boolean): Leaving | null {
  const heads = runs.flatMap(([head]) => head ?? []);
  const first = heads[0] ?? notes[0];
  if (!first) return null;
  const all = [...runs.flat(), ...notes];
  return {
    copied: copyOfAll(runs, notes),
    how: copies || !all.every((each) => each.isDeletable()) ? 'copied' : 'moved',
    heads,
    place: first.getRelativeToSurfaceXY(),
    isGone: () => all.some((each) => each.isDeadOrDying()),
    remove: () => removeAll(runs, notes),
  };
}

export class Carrying {
  private mouse: Point | null = null;
  private frame = 0;
  private isTold = false;
  private held: {tab: Tab; what: Leaving} | null = null;
  /** What undoes the last one, the other behaviour first. */
  private steps: Step[] = [];

  constructor(private readonly window: CarryingWindow) {}

  /** Where the mouse is, while that is outside; told once in a frame. */
  over(mouse: Point | null): void {
    this.mouse = mouse;
    if (mouse) this.frame ||= window.requestAnimationFrame(() => this.tell());
    else this.tell();
  }

  letGo(tab: Tab, what: Leaving, mouse: Point): void {
    this.held = {tab, what};
    this.window.dropped(Math.round(mouse.x), Math.round(mouse.y));
  }

  /** Lays it free on the canvas of `to`, in sight and selected, and takes it away where it was. */
  bring(to: Tab): void {
    const {held} = this;
    this.held = null;
    if (!held || held.tab === to) return;
    const {tab: from, what} = held;
    this.steps = [];
    if (!this.lay(what.copied, to)) return;
    if (what.how === 'moved' && !what.isGone()) this.remove(what, from);
    this.window.brought(countIn(what.copied), what.how);
  }

  /** Undoes the last `bring`, in both behaviours, after the edits of this frame have reached the lists of edits. */
  giveBack(): void {
    const {steps} = this;
    this.steps = [];
    window.requestAnimationFrame(() => window.setTimeout(() => {
      for (const {tab, group, otherwise} of steps) {
        const stack = tab.workspace.getUndoStack();
        if (stack[stack.length - 1]?.group === group) tab.program.undo(false);
        else if (tab.workspace.rendered) otherwise();
      }
    }));
  }

  private tell(): void {
    window.cancelAnimationFrame(this.frame);
    this.frame = 0;
    if (!this.mouse && !this.isTold) return;
    this.isTold = this.mouse !== null;
    this.window.carried(Math.round(this.mouse?.x ?? 0), Math.round(this.mouse?.y ?? 0), this.isTold);
  }

  private lay(copied: Copied | CopiedBlocks, tab: Tab): boolean {
    const {workspace} = tab;
    const {left, right, top, bottom} = inSight(workspace);
    const wanted = new Blockly.utils.Coordinate(left + (right - left) / 4, top + (bottom - top) / 4);
    const [made, group] = inOneStep(() => [add(copied, workspace, wanted), Blockly.Events.getGroup()] as const);
    const [first] = made;
    if (!first) return false;
    const box = (first as Blockly.IBoundedElement).getBoundingRectangle();
    if (first instanceof Blockly.BlockSvg && !inSight(workspace).contains(box.left, box.top)) tab.reveal(first.id);
    this.steps.push({tab, group, otherwise: () => inOneStep(() => made.forEach((each) => !each.isDeadOrDying() && each.dispose()))});
    return true;
  }

  private remove({heads, copied, place, remove}: Leaving, tab: Tab): void {
    const where = heads[0]?.getRelativeToSurfaceXY() ?? place;
    const group = inOneStep(() => {
      for (const {id} of heads) tab.bin.leaves(id);
      remove();
      return Blockly.Events.getGroup();
    });
    this.steps.push({tab, group, otherwise: () => void add(copied, tab.workspace, where)});
  }
}

/** How many blocks a person sees in it; 0: it is a note. */
function countIn(copied: Copied | CopiedBlocks): number {
  if (copied.nepStudio === 'note') return 0;
  const states = copied.nepStudio === 'blocks' ? copied.states : [copied.state];
  return states.reduce((sum, each) => sum + countOf(each as Blockly.serialization.blocks.State), 0);
}
