// Notes: sheets of text beside a block, or anywhere on the canvas. They are Blockly's comments and are saved as such;
// here they get our look, take the keys when they are made, and keep what is typed.
import * as Blockly from 'blockly/core';
import {seenInPlaceOf} from './folding';
import {freePlace, inSight, obstacles} from './free_place';
import {drawIcon} from './icons';
import {t} from './words';

const {Coordinate, Rect, Size} = Blockly.utils;
const SVG = 'http://www.w3.org/2000/svg';
const SIGN = 20;
const HEAD = 26;
const BORDER = 6;
const FROM_BLOCK = 26;
const GAP = 12;
/** From a new note to the edge of what can be seen, beside a scrollbar. */
const IN_SIGHT = 24;
const FIRST_SIZE = [230, 128] as const;
const TYPED_MS = 200;
const FONT = 14;
/** On the screen no letter is smaller, however far away the canvas is; up to a size that still fits into a sheet. */
const SMALLEST = 12;
const LARGEST = 30;

// ---- what is typed

/** Where something was typed that Blockly does not know yet: it asks only when the field is left. */
const typed = new Set<HTMLTextAreaElement>();
let telling = 0;

/** Tells Blockly what was typed so far; before anything is saved, and when the person rests. */
export function keepTyped(): void {
  window.clearTimeout(telling);
  for (const area of [...typed]) {
    typed.delete(area);
    area.dispatchEvent(new Event('change'));
  }
}

document.addEventListener('input', (event) => {
  const area = event.target;
  if (!(area instanceof HTMLTextAreaElement) || !area.classList.contains('blocklyCommentText')) return;
  typed.add(area);
  window.clearTimeout(telling);
  telling = window.setTimeout(keepTyped, TYPED_MS);
}, true);

/** Esc leaves the words of a note on the canvas for the note. Blockly forgets to make it ready for the keys. */
document.addEventListener('keydown', (event) => {
  const note = event.key === 'Escape' && event.target instanceof HTMLTextAreaElement ?
    event.target.closest<SVGElement>('.blocklyComment') : null;
  const workspace = Blockly.common.getMainWorkspace();
  const comment = note && workspace.getCommentById(note.dataset['id'] ?? '');
  if (!(comment instanceof Blockly.comments.RenderedWorkspaceComment)) return;
  event.stopPropagation();
  keepTyped();
  Blockly.getFocusManager().focusNode(comment);
}, true);

// ---- the sheet of a block

class Sheet extends Blockly.bubbles.TextInputBubble {
  private buttons: SVGGElement[] | undefined;
  /** Before the person took it into the hand. */
  private before: Shape | null = null;

  /** A head to take it by, with its buttons; made before the first size is set, which the parent does. */
  addHead(buttons: [icon: string, words: string, run: () => void][]): void {
    this.svgRoot.classList.add('nepNote');
    this.buttons = buttons.map(([icon, words, run]) => {
      const button = element('g', 'nepNoteButton');
      button.setAttribute('role', 'button');
      button.setAttribute('aria-label', words);
      const title = element('title', '');
      title.textContent = words;
      const ground = element('rect', '');
      for (const [name, value] of [['width', 22], ['height', 22], ['rx', 5]] as const) ground.setAttribute(name, `${value}`);
      const picture = element('g', '');
      picture.setAttribute('transform', 'translate(4, 4)');
      drawIcon(picture, icon, 14);
      button.append(title, ground, picture);
      button.addEventListener('pointerdown', (event) => event.stopPropagation());
      button.addEventListener('click', run);
      this.svgRoot.append(button);
      return button as SVGGElement;
    });
    this.setSize(this.getSize());
  }

  set isSeen(seen: boolean) {
    this.svgRoot.style.display = seen ? '' : 'none';
  }

  private get sign(): NoteSign {
    return this.getOwner() as NoteSign;
  }

  override startDrag(): Blockly.IBubble {
    this.before = this.sign.shape;
    return super.startDrag();
  }

  override endDrag(): void {
    super.endDrag();
    this.tell();
  }

  /** The corner is in the hand until the button is let go, wherever that is. */
  watchCorner(): void {
    this.svgRoot.querySelector('.blocklyResizeHandle')?.addEventListener('pointerdown', () => {
      this.before = this.sign.shape;
      const end = new AbortController();
      for (const name of ['pointerup', 'pointercancel']) {
        window.addEventListener(name, () => {
          end.abort();
          this.tell();
        }, {signal: end.signal});
      }
    });
  }

  private tell(): void {
    if (this.before && !this.disposed) this.sign.tellChange(this.before);
    this.before = null;
  }

  protected override onKeyDown(event: KeyboardEvent): void {
    const before = this.sign.shape;
    super.onKeyDown(event);
    this.sign.tellChange(before);
  }

  override setSize(size: Blockly.utils.Size, relayout = false): void {
    super.setSize(size, relayout);
    const {width, height} = this.getSize();
    const text = this.getEditor().getDom();
    text.setAttribute('y', `${HEAD}`);
    text.setAttribute('height', `${Math.max(10, height - HEAD - BORDER)}`);
    this.buttons?.forEach((button, at) =>
      button.setAttribute('transform', `translate(${width - 26 - 24 * at}, 3)`));
  }
}

/** Where a sheet is, beside the corner of its block, how large, and whether it shows. */
interface Shape {
  open: boolean;
  width: number;
  height: number;
  at: {x: number; y: number} | null;
}

/** A sheet was moved, resized, opened or closed by a person: one step of undo. Blockly itself tells nobody. */
class NoteChange extends Blockly.Events.BlockBase {
  override type = 'nep_note';

  constructor(private readonly block: Blockly.Block, private readonly from: Shape, private readonly to: Shape) {
    super(block);
    this.recordUndo = Blockly.Events.getRecordUndo();
  }

  override isNull(): boolean {
    return JSON.stringify(this.from) === JSON.stringify(this.to);
  }

  override run(forward: boolean): void {
    const block = this.getEventWorkspace_().getBlockById(this.blockId ?? '') ?? this.block;
    const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
    if (!(sign instanceof NoteSign)) return;
    // A sign that was made just now takes its sheet along when it comes to its place.
    Blockly.renderManagement.triggerQueuedRenders(block.workspace as Blockly.WorkspaceSvg);
    const before = sign.shape;
    sign.shape = forward ? this.to : this.from;
    sign.tellChange(before);  // undo itself is told to nobody, what it does is
  }
}

/** Blockly's own names of where the sheet is, and of what draws from it to the block. */
interface Drawn {
  tail: SVGPathElement;
  renderTail(): void;
}

/** A thin line between block and sheet, in the place of a wedge over the block's words. */
(Sheet.prototype as unknown as Drawn).renderTail = function (this: Drawn) {
  const sheet = this as unknown as Sheet;
  const block = (sheet.getOwner() as NoteSign | undefined)?.getSourceBlock();
  if (!(block instanceof Blockly.BlockSvg)) return;
  this.tail.dataset['of'] = block.id;
  const at = sheet.getRelativeToSurfaceXY();
  const {left, right, top} = block.getBoundingRectangleWithoutChildren();
  const middle = top + HEAD / 2 - at.y;
  const {width} = sheet.getSize();
  const isRight = at.x >= right;
  const from = isRight ? right - at.x : at.x + width <= left ? left - at.x : (left + right) / 2 - at.x;
  const to = isRight ? 0 : at.x + width <= left ? width : width / 2;
  this.tail.setAttribute('d', `M${from},${middle}L${to},${HEAD / 2}`);
};

/** The id of the block whose note this sheet is. */
export function ownerOf(sheet: Element): string {
  return sheet.querySelector<SVGElement>('[data-of]')?.dataset['of'] ?? '';
}

function element(name: string, kind: string): SVGElement {
  const made = document.createElementNS(SVG, name);
  if (kind) made.setAttribute('class', kind);
  return made;
}

/** The sign on a block that has a note: shows and hides it. */
class NoteSign extends Blockly.icons.CommentIcon {
  private wasHidden = false;

  constructor(block: Blockly.Block) {
    super(block);
    this.setBubbleSize(new Size(...FIRST_SIZE));
  }

  override initView(pressed: (event: PointerEvent) => void): void {
    if (this.svgRoot) return;
    super.initView(pressed);
    const ground = element('rect', '');
    for (const [name, value] of [['width', SIGN], ['height', SIGN], ['rx', 5]] as const) ground.setAttribute(name, `${value}`);
    const picture = element('g', '');
    picture.setAttribute('transform', 'translate(3, 3)');
    drawIcon(picture, 'sticky-note', SIGN - 6);
    this.svgRoot!.replaceChildren(ground, picture);
    this.svgRoot!.classList.add('nepNoteSign');
  }

  override getSize(): Blockly.utils.Size {
    return new Size(SIGN, SIGN);
  }

  /** A folded block still has its own note. */
  override isShownWhenCollapsed(): boolean {
    return true;
  }

  override updateCollapsed(): void {}

  /** Its sheet is seen, or not, as its block is. */
  set isSeen(seen: boolean) {
    const sheet = this.getBubble();
    if (sheet instanceof Sheet) sheet.isSeen = seen;
  }

  override async setBubbleVisible(visible: boolean): Promise<void> {
    keepTyped();
    // A block that is folded up closes all sheets inside it: they are only not seen until it is unfolded.
    if (!visible && this.getBubble() && this.isHidden()) return;
    await super.setBubbleVisible(visible);
  }

  private isHidden(): boolean {
    const block = this.sourceBlock;
    return block instanceof Blockly.BlockSvg && !block.isDeadOrDying() && seenInPlaceOf(block) !== block;
  }

  /** What is folded up has no place of its own: the sheet stays where it was until its block has one again. */
  override onLocationChange(corner: Blockly.utils.Coordinate): void {
    const kept = this.getBubbleLocation();
    const unfolded = this.wasHidden && !this.isHidden();
    this.wasHidden = this.isHidden();
    super.onLocationChange(corner);
    if (unfolded && kept) this.setBubbleLocation(kept);
  }

  override onClick(): void {
    const before = this.shape;
    super.onClick();
    this.tellChange(before);
  }

  get shape(): Shape {
    const {width, height} = this.getBubbleSize();
    const at = this.getBubbleLocation();
    const corner = (this.sourceBlock as Blockly.BlockSvg).getRelativeToSurfaceXY();
    return {open: this.bubbleIsVisible(), width, height, at: at ? {x: at.x - corner.x, y: at.y - corner.y} : null};
  }

  set shape({open, width, height, at}: Shape) {
    const corner = (this.sourceBlock as Blockly.BlockSvg).getRelativeToSurfaceXY();
    this.setBubbleSize(new Size(width, height));
    if (at) this.setBubbleLocation(new Coordinate(corner.x + at.x, corner.y + at.y));
    void this.setBubbleVisible(open);
  }

  /** The file is another one now, and undo brings back how the sheet was. */
  tellChange(before: Shape, now = this.shape): void {
    // A sheet that was never open has found its place: that alone is nothing to undo.
    Blockly.Events.fire(new NoteChange(this.sourceBlock, before.at ? before : {...before, at: now.at}, now));
  }

  protected override createBubble(): void {
    const block = this.sourceBlock as Blockly.BlockSvg;
    const anchor = Coordinate.sum(this.workspaceLocation, new Coordinate(SIGN / 2, SIGN / 2));
    const sheet = new Sheet(block.workspace, anchor, block.getBoundingRectangleWithoutChildren(), this);
    (this as unknown as {textInputBubble: Sheet}).textInputBubble = sheet;
    sheet.getEditor().setParent(block);
    sheet.setText(this.getText());
    sheet.setSize(this.getBubbleSize(), true);
    sheet.addHead([
      ['x', t('Hide the note'), () => this.onClick()],
      ['trash-2', t('Remove the note'), () => removeNote(block)],
    ]);
    sheet.moveDuringDrag(this.getBubbleLocation() ?? placeOf(sheet, block));
    this.setBubbleLocation(sheet.getRelativeToSurfaceXY());
    // The first two listeners of Blockly's own kind are added by the parent.
    sheet.addLocationChangeListener(() => this.onBubbleLocationChange());
    sheet.setAriaLabelProvider(() => t('Note: {text}', {text: this.getText()}));
    this.watchKeys(sheet, block);
    sheet.watchCorner();
    sheet.isSeen = seenInPlaceOf(block) === block;
  }

  private watchKeys(sheet: Sheet, block: Blockly.BlockSvg): void {
    const text = sheet.getEditor().getDom();
    text.addEventListener('keydown', (event) => {
      if (event.key !== 'Escape') return;
      event.stopPropagation();
      keepTyped();
      Blockly.getFocusManager().focusNode(block);
    }, true);
    // A note in which nothing was written would not be saved: it goes when it is left.
    text.addEventListener('focusout', () => window.setTimeout(() => {
      keepTyped();
      if (!text.contains(document.activeElement) && !block.isDeadOrDying() && this.getText() === '') removeNote(block);
    }));
  }
}

/** Beside the block: on no other block of its stack, on no other stack, in sight. */
function placeOf(sheet: Sheet, block: Blockly.BlockSvg): Blockly.utils.Coordinate {
  const {workspace} = block;
  const root = block.getRootBlock();
  const rows = root.getDescendants(false).filter((each) => !each.outputConnection)
    .map((each) => each.getBoundingRectangleWithoutChildren());
  const {right, top} = block.getBoundingRectangle();
  const wanted = new Coordinate(right + FROM_BLOCK, top);
  const {width, height} = sheet.getSize();
  return freePlace(wanted, {width, height}, [...obstacles(workspace, new Set([root])), ...rows], inSight(workspace), GAP);
}

Blockly.icons.registry.unregister(Blockly.icons.IconType.COMMENT.toString());
Blockly.icons.registry.register(Blockly.icons.IconType.COMMENT, NoteSign);

function inOneStep(change: () => void): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  change();
  Blockly.Events.setGroup(group);
}

export function hasNote(block: Blockly.BlockSvg): boolean {
  return block.hasIcon(Blockly.icons.IconType.COMMENT);
}

export function removeNote(block: Blockly.BlockSvg): void {
  const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
  if (!(sign instanceof NoteSign)) return;
  inOneStep(() => {
    sign.tellChange(sign.shape, {...sign.shape, open: false});  // undo brings it back as it was
    block.setCommentText(null);
  });
}

/** The words of its note; '' when it has none. */
export function wordsOfNote(block: Blockly.BlockSvg): string {
  return block.getIcon(Blockly.icons.IconType.COMMENT)?.getText() ?? '';
}

/** The sheet of a note goes and comes with the block that it is beside. */
export function showNote(block: Blockly.BlockSvg, seen: boolean): void {
  const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
  if (sign instanceof NoteSign) sign.isSeen = seen;
}

/** An open note that has the keys. */
export async function addNote(block: Blockly.BlockSvg): Promise<void> {
  inOneStep(() => block.setCommentText(''));
  const sign = block.getIcon(Blockly.icons.IconType.COMMENT);
  if (!(sign instanceof NoteSign)) return;
  await sign.setBubbleVisible(true);
  const sheet = sign.getBubble();
  if (!(sheet instanceof Sheet)) return;
  Blockly.getFocusManager().focusNode(sheet.getEditor());
  const {x, y} = sheet.getRelativeToSurfaceXY();
  const {width, height} = sheet.getSize();
  block.workspace.scrollBoundsIntoView(new Rect(y, y + height, x, x + width), IN_SIGHT);  // where all is full it is far off
}

/** A note on the canvas itself, at a place of the page. */
export function addCanvasNote(workspace: Blockly.WorkspaceSvg, place: {x: number; y: number}): void {
  const at = Blockly.utils.svgMath.screenToWsCoordinates(workspace, new Coordinate(place.x, place.y));
  inOneStep(() => {
    const note = new Blockly.comments.RenderedWorkspaceComment(workspace);
    note.setSize(new Size(...FIRST_SIZE));
    note.moveTo(at);
    Blockly.getFocusManager().focusNode(note.view.getEditorFocusableNode());
  });
}

/** Lets the words of notes be readable however far away the canvas is. */
export function keepNotesReadable(workspace: Blockly.WorkspaceSvg): void {
  let scale = 0;
  const adapt = () => {
    if (workspace.scale === scale) return;
    ({scale} = workspace);
    const size = Math.min(LARGEST, Math.max(FONT, SMALLEST / scale));
    workspace.getInjectionDiv().style.setProperty('--nep-noteFont', `${size}px`);
  };
  adapt();
  workspace.addChangeListener((event) => event.type === Blockly.Events.VIEWPORT_CHANGE && adapt());
}
