// What the blocks show while a program runs: glow, outlines, sentences, absent robots, live values.
import * as Blockly from 'blockly/core';
import {Bubbles, type Said} from './bubbles';
import {definitionOf, sensorTypes} from './definitions';
import {FieldLive} from './fields';
import {seenInPlaceOf} from './folding';
import {isUnknown} from './unknown_blocks';
import {type BlockState, pathOf} from './renderer';
import {t} from './words';

const PICTURE_MS = 66;

export class Overlays {
  private running = new Set<string>();
  private next: string[] = [];
  private resting = 0;
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

  /** The first at once, the next ones as often as an eye can follow: each is a picture of the whole page. */
  highlight(ids: string[]): void {
    this.next = ids;
    if (this.resting) return;
    this.running = new Set(ids);
    this.outline();
    this.resting = window.setTimeout(() => {
      this.resting = 0;
      const {next} = this;
      if (next.length !== this.running.size || next.some((id) => !this.running.has(id))) this.highlight(next);
    }, PICTURE_MS);
  }

  markStopped(ids: string[]): void {
    this.stopped = new Set(ids);
    this.outline();
  }

  /** The outline and its sentence in one step: nobody sees one without the other. */
  setErrors(errors: Record<string, string>): void {
    this.errors = new Map(Object.entries(errors));
    this.outline();
    this.talk();
  }

  /** A sentence beside each of these blocks; what they do goes on, so they have no outline. */
  setWarnings(warnings: Record<string, string>): void {
    this.warnings = new Map(Object.entries(warnings));
    this.talk();
  }

  setAbsent(ids: string[]): void {
    this.absent = new Set(ids);
    this.dress();
  }

  /** Keys: a block's id, or `<robot>/<property>` and perhaps `/<field>` for every block that reads this sensor. */
  setLive(values: Record<string, string>, old: string[]): void {
    this.live = new Map(Object.entries(values));
    this.old = new Set(old);
    this.showLive();
  }

  /** Another program is here: nothing of it runs, nothing is wrong with it. */
  forget(): void {
    window.clearTimeout(this.resting);
    this.resting = 0;
    this.next = [];
    this.running = new Set();
    this.stopped = new Set();
    this.errors = new Map();
    this.warnings = new Map();
    this.absent = new Set();
    this.talk();
    this.restore();
  }

  /** Puts everything on again after the blocks were made anew. */
  restore(): void {
    this.outlined.clear();
    this.outline();
    this.dress();
    this.showLive();
    this.bubbles.placeSoon();
  }

  private onEvent(event: Blockly.Events.Abstract): void {
    if (event.type === Blockly.Events.BLOCK_CREATE) this.restore();
    else if (event instanceof Blockly.Events.BlockChange && event.element === 'collapsed') this.outline();
    else if (event.type === Blockly.Events.BLOCK_CHANGE || event.type === Blockly.Events.TOOLBOX_ITEM_SELECT) {
      this.showLive();
    }
    this.bubbles.placeSoon();
  }

  /** Only blocks whose state differs are touched: this runs 30 times a second. */
  private outline(): void {
    const wanted = new Map<string, BlockState>();
    // What counts most comes last: a folded block shows the state of all that is in it.
    for (const id of this.stopped) wanted.set(this.seen(id), 'stopped');
    for (const id of this.errors.keys()) wanted.set(this.seen(id), 'error');
    for (const id of this.running) wanted.set(this.seen(id), 'running');
    for (const id of this.outlined) if (!wanted.has(id)) this.setState(id, null);
    for (const [id, state] of wanted) this.setState(id, state);
  }

  /** The block that shows what this one does. */
  private seen(id: string): string {
    const block = this.workspace.getBlockById(id);
    return block ? seenInPlaceOf(block).id : id;
  }

  private setState(id: string, state: BlockState | null): void {
    // A block of the toolbox that is tried glows as well.
    const block = this.workspace.getBlockById(id) ??
      this.workspace.getFlyout()?.getWorkspace().getBlockById(id) as Blockly.BlockSvg | undefined;
    if (block) pathOf(block)?.setState(state);
    if (state && block) this.outlined.add(id);
    else this.outlined.delete(id);
  }

  private dress(): void {
    for (const block of this.workspace.getAllBlocks(false)) {
      const parent = block.isShadow() ? block.getParent() : null;
      const grey = isUnknown(block) || this.absent.has(block.id) || (parent !== null && this.absent.has(parent.id));
      const root = block.getSvgRoot();
      if (root.classList.contains('nepAbsent') === grey) continue;
      root.classList.toggle('nepAbsent', grey);
      if (isUnknown(block)) continue;
      block.setTooltip(grey ? absentSentence(block) : String(definitionOf(block.type)?.['tooltip'] ?? ''));
    }
  }

  /** Five times a second: only blocks of sensors are looked at, and only new words are drawn. */
  showLive(): void {
    const flyout = this.workspace.getFlyout()?.getWorkspace();
    for (const workspace of flyout ? [this.workspace, flyout] : [this.workspace]) {
      for (const type of sensorTypes()) {
        for (const block of workspace.getBlocksByType(type, false)) this.showLiveOn(block);
      }
    }
  }

  private showLiveOn(block: Blockly.Block): void {
    for (const field of block.getFields()) {
      if (!(field instanceof FieldLive)) continue;
      const key = this.live.has(block.id) ? block.id : sensorKey(block);
      field.show(this.live.get(key) ?? '', this.old.has(key));
    }
  }

  /** A block that failed says that; what it was warned of before matters less. */
  private talk(): void {
    const said = new Map<string, Said>();
    for (const [id, sentence] of this.warnings) said.set(id, ['warning', sentence]);
    for (const [id, sentence] of this.errors) said.set(id, ['error', sentence]);
    this.bubbles.say(said);
  }
}

/** The robot and its sensor that a block reads. */
export function sensorOf(block: Blockly.Block): [robot: string, sensor: string] {
  return [String(block.getFieldValue('ROBOT') ?? ''), block.type.split('_get_')[1] ?? ''];
}

function sensorKey(block: Blockly.Block): string {
  const part = block.getFieldValue('FIELD');
  return [...sensorOf(block), ...(typeof part === 'string' ? [part] : [])].join('/');
}

function absentSentence(block: Blockly.Block): string {
  const robot = block.getField('ROBOT')?.getText();
  return robot ? t('{robot} isn\'t connected. This block is skipped when the program runs.', {robot}) :
    t('The robot isn\'t connected. This block is skipped when the program runs.');
}
