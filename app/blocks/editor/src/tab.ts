// Tab of one behaviour: a workspace with its own undo stack, zoom, scroll position and open category.
import * as Blockly from 'blockly/core';
import {Backpack} from './backpack';
import {Bin} from './bin';
import {send} from './channel';
import {CHECKER} from './checker';
import {FieldChoice} from './choices';
import {Culling} from './culling';
import {collapseOnDoubleClick} from './folding';
import {Marquee} from './frame';
import {DRAGGER, setDragListener} from './drag';
import {Functions} from './functions';
import {FLYOUT, Flyout, DEFAULT_SCALE} from './flyout';
import {RejectedDrops} from './wrong_drop';
import {Variables} from './variables';
import {visibleSensors, observeFlyout} from './visible_sensors';
import {registerInsideMarks} from './inside_marks';
import type {VariableEdit} from './messages';
import {keepNotesReadable} from './notes';
import type {OutgoingDrag} from './outgoing_drag';
import {Program, hasBlockOfTypes} from './program';
import {RENDERER} from './renderer';
import {type Item, Selection} from './selection';
import {Overlays} from './overlays';
import {makeTheme} from './theme';
import {Toolbox} from './toolbox';
import {editVariable, registerVariableButtons} from './variable_edits';
import {WatchedValues} from './watched_values';
import {TryHandle} from './tries';

export interface TabListener {
  isActive(tab: Tab): boolean;
  /** An edit of the blocks was sent to the window. */
  edited(): void;
  /** The set of watched variables has changed. */
  watched(tab: Tab): void;
  /** A workspace was created. */
  made(tab: Tab): void;
  /** The sensors shown in the toolbox may have changed. */
  offered(tab: Tab): void;
  /** The user has pinned or unpinned the flyout. */
  pinned(isPinned: boolean): void;
  /** The number of deletions in the bin has changed. */
  binned(tab: Tab): void;
  /** The dragged items are outside the page at this position; null: they are inside again. */
  outside(mouse: Blockly.utils.Coordinate | null, items?: readonly Item[]): void;
  /** The dragged items were dropped outside the page. */
  droppedOutside(tab: Tab, drag: OutgoingDrag, mouse: Blockly.utils.Coordinate): void;
  /** A drag has ended; see `DragListener`. */
  dragEnded(isPlaced: boolean, isCopy: boolean): void;
}

export class Tab {
  readonly workspace: Blockly.WorkspaceSvg;
  readonly program: Program;
  readonly overlays: Overlays;
  readonly watched: WatchedValues;
  readonly bin: Bin;
  readonly backpack: Backpack;
  private readonly functions: Functions;
  private readonly variables: Variables;
  private readonly culling: Culling;
  private readonly rejectedDrops: RejectedDrops;
  key = '';
  generation = 0;
  private readonly frame = document.createElement('div');
  /** Block types whose definitions have changed since the last update of this tab. */
  private readonly outdated = new Set<string>();
  private toolboxDefinition: unknown = null;
  private areChoicesOutdated = false;
  private isThemeOutdated = false;

  constructor(container: HTMLElement, private readonly listener: TabListener) {
    this.frame.className = 'nepTab';
    container.append(this.frame);
    this.workspace = Blockly.inject(this.frame, {
      media: 'media/', renderer: RENDERER, sounds: false, trashcan: false, theme: makeTheme(),
      toolbox: {kind: 'categoryToolbox', contents: []},
      plugins: {toolbox: Toolbox, [Blockly.registry.Type.FLYOUTS_VERTICAL_TOOLBOX.toString()]: FLYOUT,
        [Blockly.registry.Type.BLOCK_DRAGGER.toString()]: DRAGGER,
        [Blockly.registry.Type.CONNECTION_CHECKER.toString()]: CHECKER},
      grid: {spacing: 28, length: 2, snap: true, colour: 'transparent'},
      move: {scrollbars: true, drag: true, wheel: true},
      zoom: {controls: false, wheel: true, pinch: true, startScale: DEFAULT_SCALE, minScale: 0.3, maxScale: 2},
    });
    this.culling = new Culling(this.workspace);
    this.program = new Program(this.workspace, this.culling, this, () => listener.edited());
    this.overlays = new Overlays(this.workspace);
    this.functions = new Functions(this.workspace);
    collapseOnDoubleClick(this.workspace);
    new Marquee(this.workspace, new Selection(this.workspace));
    keepNotesReadable(this.workspace);
    registerInsideMarks(this.workspace);
    new TryHandle(this.workspace);
    this.variables = new Variables(this.workspace);
    this.bin = new Bin(this.workspace, {deleted: (count) => this.isActive && send({type: 'blocksDeleted', count}), changed: () => listener.binned(this)});
    this.backpack = new Backpack(this.workspace);
    this.rejectedDrops = new RejectedDrops(this.workspace);
    setDragListener(this.workspace, {
      overDelete: (mouse) => this.bin.showHint(mouse),
      dropped: (block, mouse) => this.rejectedDrops.explainDrop(block, mouse),
      placedByKeyboard: (block, target) => this.rejectedDrops.explainKeyboardDrop(block, target),
      outside: (mouse, items) => listener.outside(mouse, items),
      ended: (isPlaced, isCopy) => listener.dragEnded(isPlaced, isCopy),
      droppedOutside: (drag, mouse) => listener.droppedOutside(this, drag, mouse),
    });
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox) toolbox.onResultsShown = () => this.overlays.renderLiveValues();
    const flyout = this.workspace.getFlyout();
    if (flyout) observeFlyout(flyout, () => listener.offered(this));
    registerVariableButtons(this.workspace);
    this.watched = new WatchedValues(this.workspace, this.frame, {
      changed: () => {
        this.program.scheduleFlush();
        listener.watched(this);
      },
    });
    listener.made(this);
    if (flyout instanceof Flyout) flyout.onPin = (isPinned) => listener.pinned(isPinned);
  }

  /** Loads other blocks and clears the undo history. */
  load(generation: number, state: Record<string, unknown>): void {
    this.cancelInteraction();
    this.program.load(state);
    this.functions.refresh();
    this.variables.refresh();
    this.generation = generation;
    this.overlays.reset();
    this.bin.clear();
  }

  /** Replaces the blocks as one undoable edit. */
  change(state: Record<string, unknown>): void {
    this.cancelInteraction();
    this.program.change(state);
    this.functions.refresh();
    this.variables.refresh();
    this.overlays.restore();
  }

  show(): void {
    this.frame.hidden = false;
    Blockly.common.setMainWorkspace(this.workspace);
    // Blockly pastes into the workspace of the copy; users expect the visible one.
    Blockly.clipboard.setLastCopiedWorkspace(this.workspace);
    this.resize();
    this.update();
    this.program.notifyHistory(true);
  }

  /** Adapts the workspace to the size of the page. */
  resize(): void {
    Blockly.svgResize(this.workspace);
    this.culling.scheduleUpdate();
  }

  /** Pins or unpins the flyout of the open category; `shouldClose`: unpinning also shouldClose it. */
  setPinned(isPinned: boolean, shouldClose = false): void {
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox) toolbox.setPinned(isPinned, shouldClose);
  }

  /** Flushes pending edits and hides the tab; later updates are applied in `show`. */
  hide(): void {
    this.cancelInteraction();
    Blockly.renderManagement.triggerQueuedRenders();
    this.program.flush();
    this.frame.hidden = true;
  }

  dispose(): void {
    this.cancelInteraction();
    this.program.dispose();
    this.bin.dispose();
    this.backpack.dispose();
    this.rejectedDrops.dispose();
    this.workspace.dispose();
    this.frame.remove();
  }

  /** Cancels the current drag and closes open fields and menus. */
  cancelInteraction(): void {
    this.workspace.hideChaff();
    this.workspace.getGesture(new PointerEvent('pointercancel'))?.cancel();
  }

  /** True if this is the visible tab. */
  get isActive(): boolean {
    return this.listener.isActive(this);
  }

  get hasFocus(): boolean {
    return this.frame.contains(document.activeElement);
  }

  focus(): void {
    Blockly.getFocusManager().focusTree(this.workspace);
  }

  themeChanged(): void {
    this.isThemeOutdated = true;
    if (!this.frame.hidden) this.update();
  }

  definitionsChanged(types: Iterable<string>, toolbox: unknown, haveChoicesChanged: boolean): void {
    for (const type of types) this.outdated.add(type);
    this.toolboxDefinition = toolbox;
    this.areChoicesOutdated ||= haveChoicesChanged;
    if (!this.frame.hidden) this.update();
  }

  /** Applies the changes of theme, definitions and toolbox that arrived while the tab was hidden. */
  private update(): void {
    if (this.isThemeOutdated) this.workspace.setTheme(makeTheme());
    const isRebuilt = this.outdated.size > 0 && hasBlockOfTypes(this.workspace, this.outdated);
    if (isRebuilt) {
      this.program.flush();
      this.program.rebuild();
      this.functions.refresh();
      this.variables.refresh();
    }
    if (this.isThemeOutdated || isRebuilt) this.overlays.restore();
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox && this.toolboxDefinition) {
      toolbox.update(this.toolboxDefinition, this.outdated.size > 0);
    }
    if (this.areChoicesOutdated) this.refreshChoices();
    this.outdated.clear();
    this.toolboxDefinition = null;
    this.areChoicesOutdated = this.isThemeOutdated = false;
  }

  private refreshChoices(): void {
    const flyout = this.workspace.getFlyout()?.getWorkspace();
    for (const workspace of flyout ? [this.workspace, flyout] : [this.workspace]) {
      for (const block of workspace.getAllBlocks(false)) {
        for (const field of block.getFields()) if (field instanceof FieldChoice) field.refresh();
      }
    }
  }

  /** Focuses the search field of the toolbox. */
  search(): void {
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox) toolbox.focusSearch();
  }

  /** Sensors shown in the open flyout. */
  get offered(): [robot: string, sensor: string][] {
    return visibleSensors(this.workspace.getFlyout());
  }

  /** True while a block is dragged in this workspace. */
  get isDragging(): boolean {
    return this.workspace.isDragging();
  }

  fit(): void {
    if (!this.workspace.getTopBlocks(false).length) return;
    this.workspace.zoomToFit();
    if (this.workspace.scale > 1) {
      this.workspace.setScale(1);
      this.workspace.scrollCenter();
    }
  }

  editVariable(edit: VariableEdit): void {
    if (edit.do === 'watch' && edit.id) this.watched.toggle(edit.id);
    else if (edit.do === 'new' && edit.list) this.addList(edit);
    else editVariable(this.workspace, edit);
  }

  private addList(edit: VariableEdit): void {
    const variable = editVariable(this.workspace, edit);
    if (variable) this.variables.useAsList(variable);
  }

  reveal(id: string): void {
    const block = this.workspace.getBlockById(id);
    if (!block) return;
    this.workspace.centerOnBlock(id, true);
    Blockly.getFocusManager().focusNode(block);
  }
}
