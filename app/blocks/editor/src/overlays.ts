// State of the blocks while a program runs: highlights, outlines, messages, absent robots, live values.
import * as Blockly from 'blockly/core';
import {Bubbles, type BubbleContent} from './bubbles';
import {definitionOf, sensorTypes} from './definitions';
import {FieldLive} from './fields';
import {visibleBlockOf} from './folding';
import {isUnknown} from './unknown_blocks';
import {type BlockState, pathOf} from './renderer';
import {t} from './words';

const FRAME_INTERVAL_MS = 66;

export class Overlays {
  private running = new Set<string>();
  private next: readonly string[] = [];
  private throttleTimer = 0;
  private stopped = new Set<string>();
  private errors = new Map<string, string>();
  private warnings = new Map<string, string>();
  private absent = new Set<string>();
  private live = new Map<string, string>();
  private old = new Set<string>();
  private readonly outlined = new Set<string>();
  private readonly bubbles: Bubbles;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    this.bubbles = new Bubbles(workspace);
    workspace.addChangeListener((event) => this.onEvent(event));
  }

  /** Highlights the running blocks: at once, then throttled, because each update repaints the whole page. */
  highlight(ids: readonly string[]): void {
    this.next = ids;
    if (this.throttleTimer) return;
    this.running = new Set(ids);
    this.updateOutlines();
    this.throttleTimer = window.setTimeout(() => {
      this.throttleTimer = 0;
      const {next} = this;
      if (next.length !== this.running.size || next.some((id) => !this.running.has(id))) this.highlight(next);
    }, FRAME_INTERVAL_MS);
  }

  markStopped(ids: readonly string[]): void {
    this.stopped = new Set(ids);
    this.updateOutlines();
  }

  /** Sets the blocks with errors, with their outlines and messages in one step. */
  setErrors(errors: Record<string, string>): void {
    this.errors = new Map(Object.entries(errors));
    this.updateOutlines();
    this.updateBubbles();
  }

  /** Sets the warnings shown beside blocks; these blocks keep running, so they get no outline. */
  setWarnings(warnings: Record<string, string>): void {
    this.warnings = new Map(Object.entries(warnings));
    this.updateBubbles();
  }

  setAbsent(ids: readonly string[]): void {
    this.absent = new Set(ids);
    this.updateAbsentBlocks();
  }

  /** Sets live values by block id, or by `<robot>/<property>[/<field>]` for all blocks that read this sensor. */
  setLive(values: Record<string, string>, old: readonly string[]): void {
    this.live = new Map(Object.entries(values));
    this.old = new Set(old);
    this.renderLiveValues();
  }

  /** Clears all states after other blocks were loaded. */
  reset(): void {
    window.clearTimeout(this.throttleTimer);
    this.throttleTimer = 0;
    this.next = [];
    this.running = new Set();
    this.stopped = new Set();
    this.errors = new Map();
    this.warnings = new Map();
    this.absent = new Set();
    this.updateBubbles();
    this.restore();
  }

  /** Restores all states after blocks were recreated. */
  restore(): void {
    this.outlined.clear();
    this.updateOutlines();
    this.updateAbsentBlocks();
    this.renderLiveValues();
    this.bubbles.scheduleUpdate();
  }

  private onEvent(event: Blockly.Events.Abstract): void {
    if (event.type === Blockly.Events.BLOCK_CREATE) this.restore();
    else if (event instanceof Blockly.Events.BlockChange && event.element === 'collapsed') this.updateOutlines();
    else if (event.type === Blockly.Events.BLOCK_CHANGE || event.type === Blockly.Events.TOOLBOX_ITEM_SELECT) {
      this.renderLiveValues();
    }
    this.bubbles.scheduleUpdate();
  }

  /** Updates only blocks whose state has changed, because this runs many times a second. */
  private updateOutlines(): void {
    const stateById = new Map<string, BlockState>();
    // In order of priority, highest last: a collapsed block shows one state for all blocks inside it.
    for (const id of this.stopped) stateById.set(this.getVisibleBlockId(id), 'stopped');
    for (const id of this.errors.keys()) stateById.set(this.getVisibleBlockId(id), 'error');
    for (const id of this.running) stateById.set(this.getVisibleBlockId(id), 'running');
    for (const id of this.outlined) if (!stateById.has(id)) this.setState(id, null);
    for (const [id, state] of stateById) this.setState(id, state);
  }

  /** Returns the id of the block shown in place of this one. */
  private getVisibleBlockId(id: string): string {
    const block = this.workspace.getBlockById(id);
    return block ? visibleBlockOf(block).id : id;
  }

  private setState(id: string, state: BlockState | null): void {
    // Highlight a block of the toolbox that is being tried as well.
    const block = this.workspace.getBlockById(id) ??
      this.workspace.getFlyout()?.getWorkspace().getBlockById(id) as Blockly.BlockSvg | undefined;
    if (block) pathOf(block)?.setState(state);
    if (state && block) this.outlined.add(id);
    else this.outlined.delete(id);
  }

  private updateAbsentBlocks(): void {
    for (const block of this.workspace.getAllBlocks(false)) {
      const parent = block.isShadow() ? block.getParent() : null;
      const grey = isUnknown(block) || this.absent.has(block.id) || (parent !== null && this.absent.has(parent.id));
      const root = block.getSvgRoot();
      if (root.classList.contains('nepAbsent') === grey) continue;
      root.classList.toggle('nepAbsent', grey);
      if (isUnknown(block)) continue;
      block.setTooltip(grey ? absentMessage(block) : String(definitionOf(block.type)?.['tooltip'] ?? ''));
    }
  }

  /** Updates the live values, several times a second: visits only sensor blocks and redraws only changed text. */
  renderLiveValues(): void {
    const flyout = this.workspace.getFlyout()?.getWorkspace();
    for (const workspace of flyout ? [this.workspace, flyout] : [this.workspace]) {
      for (const type of sensorTypes()) {
        for (const block of workspace.getBlocksByType(type, false)) this.renderLiveValue(block);
      }
    }
  }

  private renderLiveValue(block: Blockly.Block): void {
    for (const field of block.getFields()) {
      if (!(field instanceof FieldLive)) continue;
      const key = this.live.has(block.id) ? block.id : sensorKey(block);
      field.show(this.live.get(key) ?? '', this.old.has(key));
    }
  }

  /** Updates the bubbles; an error replaces the warning of the same block. */
  private updateBubbles(): void {
    const messages = new Map<string, BubbleContent>();
    for (const [id, sentence] of this.warnings) messages.set(id, ['warning', sentence]);
    for (const [id, sentence] of this.errors) messages.set(id, ['error', sentence]);
    this.bubbles.setContents(messages);
  }
}

/** Returns the robot and the sensor that a block reads. */
export function sensorOf(block: Blockly.Block): [robot: string, sensor: string] {
  return [String(block.getFieldValue('ROBOT') ?? ''), block.type.split('_get_')[1] ?? ''];
}

function sensorKey(block: Blockly.Block): string {
  const part = block.getFieldValue('FIELD');
  return [...sensorOf(block), ...(typeof part === 'string' ? [part] : [])].join('/');
}

function absentMessage(block: Blockly.Block): string {
  const robot = block.getField('ROBOT')?.getText();
  return robot ? t('{robot} isn\'t connected. This block is skipped when the program runs.', {robot}) :
    t('The robot isn\'t connected. This block is skipped when the program runs.');
}
