// Page of the block editor: handles messages from the window (`nepReceive`) and sends messages to it.
import * as Blockly from 'blockly/core';
import './blockly_patches';
import './fields';
import './focus_after_delete';
import './mutators';
import {setBlocklyMessages} from './blockly_words';
import './near';
import './number_field';
import {type BackpackEntry, backpackButton, registerBackpack, setBackpackContents} from './backpack';
import {CrossTabDrag} from './carrying';
import {Clipboard} from './clipboard';
import {type EmptyCanvasInfo, EmptyCanvas, BlockPointer, type PointerTarget} from './guidance';
import {binButton} from './bin';
import {selectAll, marqueeButton} from './frame';
import {HelpCard, focusedBlock, registerHelpMenu} from './help';
import {Inbox} from './inbox';
import {iconElement} from './icons';
import {registerClipboardShortcuts, applyShortcutKeys} from './keys';
import {registerMenu, registerPictureMenu, configureMenu} from './menu';
import {renderPng, createPicture} from './picture';
import {type PageSetup as Paper, clearPages, layoutPages} from './print';
import {FindBar} from './search';
import {trackInputModality, setKeyboardLed} from './modality';
import {type Tab} from './tab';
import {type Definitions, type ShownTab, Tabs} from './tabs';
import {setCssVariables} from './theme';
import {type Tokens, useTokens} from './tokens';
import {type Alarm, showAlarms} from './toolbox';
import {type VariableEdit, setCommandHandler, registerVariableMenu} from './variable_edits';
import type {VariableValue} from './watched_values';
import {TryResult, registerTries} from './tries';
import {t, setTranslations} from './words';

interface Bridge {
  command_sent: {connect(slot: (name: string, payload: string) => void): void};
  initial_settings(): Promise<string>;
  ready(): void;
  changed(key: string, generation: number, json: string): void;
  history(canUndo: boolean, canRedo: boolean): void;
  selected(id: string): void;
  flushed(token: number, json: string): void;
  pictured(token: number, data: string): void;
  failed(message: string): void;
  opened(): void;
  on_block(has: boolean): void;
  show_sensors(sensors: string): void;
  copy(text: string): void;
  copied(): Promise<string>;
  command(name: string): void;
  watch_variables(variables: string): void;
  press_canvas_button(button: string): void;
  try_stack(stack: string): void;
  pin(isPinned: boolean): void;
  deleted(count: number): void;
  drag_outside(x: number, y: number, isOutside: boolean, tab: string): void;
  drag_picture(data: string, ratio: number): void;
  dropped(x: number, y: number): void;
  transferred(count: number, mode: string, sourceTab: string): void;
  backpack(json: string): void;
}

declare const QWebChannel: new (transport: unknown, callback: (channel: {objects: {bridge: Bridge}}) => void) => unknown;
declare const qt: {webChannelTransport: unknown};

class Editor {
  private readonly tabs: Tabs;
  private readonly help = new HelpCard();
  private readonly clipboard: Clipboard;
  private readonly tryAnswer = new TryResult();
  private readonly carrying: CrossTabDrag;
  private offered = '[]';
  private watched = '[]';
  private readonly find = new FindBar(() => this.activeTab.workspace);
  private readonly pointer = new BlockPointer(() => this.activeTab.workspace);
  private readonly empty: EmptyCanvas;

  constructor(private readonly bridge: Bridge, pinned: boolean | null, private theme: {tokens: Tokens; dark: boolean}) {
    this.empty = new EmptyCanvas(() => this.activeTab.workspace, this.pointer, (button) => bridge.press_canvas_button(button));
    this.carrying = new CrossTabDrag({
      carried: (x, y, isOutside, tab) => bridge.drag_outside(x, y, isOutside, tab),
      pictured: (data, ratio) => bridge.drag_picture(data, ratio),
      dropped: (x, y) => bridge.dropped(x, y),
      brought: (count, mode, sourceTab) => bridge.transferred(count, mode, sourceTab),
    }, () => this.activeTab);
    const ifActive = (tab: Tab, notify: () => void) => {
      if (tab === this.tabs?.activeTab) notify();
    };
    this.tabs = new Tabs(document.getElementById('workspace')!, {
      changed: (tab, json) => {
        bridge.changed(tab.key, tab.generation, json);
        this.find.refresh();
      },
      history: (tab, canUndo, canRedo) => ifActive(tab, () => bridge.history(canUndo, canRedo)),
      selected: (tab, id) => ifActive(tab, () => bridge.selected(id)),
      offered: (tab) => ifActive(tab, () => this.notifyOfferedSensors()),
      watched: (tab) => ifActive(tab, () => this.notifyWatched()),
      made: (tab) => this.empty.watch(tab.workspace),
      pinned: (isPinned) => {
        bridge.pin(isPinned);
        this.tabs.setPinned(isPinned);
      },
      deleted: (tab, count) => ifActive(tab, () => bridge.deleted(count)),
      binned: (tab) => ifActive(tab, () => this.updateBinButton()),
      outside: (mouse, items) => this.carrying.trackOutside(mouse, items),
      dragEnded: (isPlaced, isCopy) => this.carrying.dragEnded(isPlaced, isCopy),
      droppedOutside: (tab, drag, mouse) => this.carrying.dropOutside(tab, drag, mouse),
    });
    this.tabs.setPinned(pinned);
    // Don't resize for printing, which changes the size of the page temporarily.
    new ResizeObserver(() => window.matchMedia('print').matches || this.tabs.resize()).observe(document.body);
    // A hidden page has no animation frames, and Blockly fires events only after a frame.
    document.addEventListener('visibilitychange', () => document.hidden && this.activeTab.program.flush());
    this.createZoomButtons();
    registerTries((request) => bridge.try_stack(JSON.stringify(request)));
    registerHelpMenu((block) => this.help.show(block));
    this.clipboard = new Clipboard({write: (text) => bridge.copy(text), read: () => bridge.copied()});
    registerClipboardShortcuts(this.clipboard);
    registerMenu(this.clipboard);
    registerBackpack((json) => bridge.backpack(json), () => this.activeTab.backpack);
    registerPictureMenu((command) => bridge.command(command));
    // Send shortcuts to the canvas if no element has the focus, such as after a tab switch.
    document.addEventListener('keydown', (event) => {
      if (document.activeElement !== document.body || !(event.ctrlKey || event.metaKey)) return;
      Blockly.ShortcutRegistry.registry.onKeyDown(this.activeTab.workspace, event);
    });
    setCommandHandler((command) => bridge.command(command));
    registerVariableMenu((id) => this.activeTab.watched.isWatched(id));
    let wasOnBlock = false;
    const notifyFocusedBlock = () => queueMicrotask(() => {
      const has = focusedBlock() !== null;
      if (has !== wasOnBlock) bridge.on_block(wasOnBlock = has);
    });
    document.addEventListener('focusin', notifyFocusedBlock);
    document.addEventListener('focusout', notifyFocusedBlock);
    document.addEventListener('keydown', (event) => {
      if (event.key.toLowerCase() !== 'f' || event.altKey || !(event.ctrlKey || event.metaKey)) return;
      event.preventDefault();
      if (event.shiftKey) this.activeTab.search();
      else this.find.open();
    }, true);
  }

  receive(name: string, payload: string): void {
    const command = this.commands[name];
    if (!command) throw new Error(`no command ${name}`);
    command(JSON.parse(payload) as never);
  }

  private get activeTab(): Tab {
    return this.tabs.activeTab;
  }

  private readonly commands: Record<string, (payload: never) => void> = {
    theme: (theme: {tokens: Tokens; dark: boolean}) => this.setTheme(theme.tokens, theme.dark),
    motion: (motion: {reduced: boolean}) => document.documentElement.classList.toggle('reduced', motion.reduced),
    definitions: (definitions: Definitions) => this.tabs.define(definitions),
    tab: (tab: ShownTab) => this.showTab(tab),
    pin: (pinned: boolean | null) => this.tabs.setPinned(pinned),
    close: (key: string) => this.tabs.close(key),
    highlight: (ids: string[]) => this.activeTab.overlays.highlight(ids),
    stopped: (ids: string[]) => this.activeTab.overlays.markStopped(ids),
    errors: (errors: Record<string, string>) => this.setErrors(errors),
    value: ([id, words]: [string, string]) => this.showMessageBeside(id, words, false),
    warnings: (warnings: Record<string, string>) => this.activeTab.overlays.setWarnings(warnings),
    absent: (ids: string[]) => this.activeTab.overlays.setAbsent(ids),
    values: (values: Record<string, VariableValue>) => this.activeTab.watched.updateValues(values),
    variable: (edit: VariableEdit) => this.activeTab.editVariable(edit),
    alarms: (alarms: Record<string, Alarm>) => showAlarms(alarms),
    live: (state: {values: Record<string, string>; old: string[]}) => this.activeTab.overlays.setLive(state.values, state.old),
    flush: (token: number) => this.bridge.flushed(token, this.activeTab.program.flush()),
    picture: (request: PictureRequest) => void this.sendPicture(request),
    pages: (request: Paper & {token: number}) => this.preparePrint(request),
    printed: () => clearPages(),
    change: (state: Record<string, unknown>) => this.activeTab.change(state),
    undo: () => this.activeTab.program.undo(false),
    bring: () => this.carrying.dropInto(this.activeTab),
    giveBack: () => this.carrying.undoDrop(),
    backpack: (items: BackpackEntry[]) => setBackpackContents(items),
    undelete: () => this.activeTab.bin.undoLast() && this.activeTab.program.undo(false),
    redo: () => this.activeTab.program.undo(true),
    zoom: (steps: number) => this.activeTab.workspace.zoomCenter(steps),
    fit: () => this.activeTab.fit(),
    show: (id: string) => this.activeTab.reveal(id),
    help: () => this.help.show(focusedBlock()),
    find: () => {
      this.find.open();
      this.bridge.opened();
    },
    keyboard: () => setKeyboardLed(true),
    search: () => {
      this.activeTab.search();
      this.bridge.opened();
    },
    edit: (action: 'copy' | 'cut' | 'paste' | 'duplicate' | 'selectAll') => {
      // The command can arrive before the page gets the focus; until then, Blockly has no selected block.
      if (!this.activeTab.hasFocus || !Blockly.getFocusManager().getFocusedNode()) this.activeTab.focus();
      if (action === 'selectAll') selectAll(this.activeTab.workspace);
      else void this.clipboard[action]();
    },
    begin: (info: EmptyCanvasInfo | null) => info && this.empty.setInfo(info),
    point: (target: PointerTarget | null) => this.pointer.show(target),
  };

  /** Shows errors on their blocks, also on a block of the toolbox that was tried. */
  private setErrors(errors: Record<string, string>): void {
    this.activeTab.overlays.setErrors(errors);
    for (const [id, sentence] of Object.entries(errors)) {
      if (!this.activeTab.workspace.getBlockById(id)) this.showMessageBeside(id, sentence, true);
    }
  }

  private showMessageBeside(id: string, text: string, isError: boolean): void {
    const {workspace} = this.activeTab;
    const block = workspace.getBlockById(id) ?? workspace.getFlyout()?.getWorkspace().getBlockById(id);
    if (block instanceof Blockly.BlockSvg) this.tryAnswer.show(block, text, isError);
  }

  private showTab(tab: ShownTab): void {
    this.help.close();
    this.carrying.switchTab(() => this.tabs.show(tab));
    this.find.refresh();
    this.empty.scheduleUpdate();
    this.updateBinButton();
    this.notifyOfferedSensors();
    this.notifyWatched();
  }

  /** Requests the values of the watched variables from the window. */
  private notifyWatched(): void {
    const watched = JSON.stringify(this.activeTab.watched.ids);
    if (watched !== this.watched) this.bridge.watch_variables(this.watched = watched);
  }

  /** Requests the values of the sensors shown in the toolbox from the window. */
  private notifyOfferedSensors(): void {
    const offered = JSON.stringify(this.activeTab.offered);
    if (offered !== this.offered) this.bridge.show_sensors(this.offered = offered);
  }

  /** Runs `draw` with the light theme. */
  private withLightTheme<T>(draw: () => T): T {
    const {tokens, dark} = this.theme;
    if (dark) this.setTheme(tokens, false);  // never visible: the theme is restored before the next paint
    try {
      return draw();
    } finally {
      if (dark) this.setTheme(tokens, true);
    }
  }

  /** Lays out the pages to print and reports their number to the window; "" if there are no blocks. */
  private preparePrint({token, ...paper}: Paper & {token: number}): void {
    let count = 0;
    try {
      count = this.withLightTheme(() => layoutPages(this.activeTab.workspace, paper));
    } finally {
      this.bridge.pictured(token, count ? `${count}` : '');
    }
  }

  /** Sends a picture of the blocks to the window; "" if there are no blocks. */
  private async sendPicture({token, kind, white}: PictureRequest): Promise<void> {
    let data = '';
    try {
      const picture = await this.withLightTheme(() => createPicture(this.activeTab.workspace, white));
      if (picture) data = kind === 'svg' ? picture.svg : await renderPng(picture);
    } finally {
      this.bridge.pictured(token, data);
    }
  }

  private setTheme(tokens: Tokens, dark: boolean): void {
    this.theme = {tokens, dark};
    useTokens(tokens, dark);
    setCssVariables(dark);
    this.tabs.themeChanged();
  }

  private createZoomButtons(): void {
    const box = document.createElement('div');
    box.className = 'nepZoom';
    const buttons: [string, string, () => void][] = [
      ['zoom-in', t('Zoom in'), () => this.activeTab.workspace.zoomCenter(1)],
      ['zoom-out', t('Zoom out'), () => this.activeTab.workspace.zoomCenter(-1)],
      ['maximize', t('Show everything'), () => this.activeTab.fit()],
    ];
    for (const [icon, name, action] of buttons) {
      const button = document.createElement('button');
      button.type = 'button';
      button.title = name;
      button.setAttribute('aria-label', name);
      button.append(iconElement(icon, 18));
      button.onclick = action;
      box.append(button);
    }
    const bin = binButton();
    bin.onclick = (event) => this.activeTab.bin.toggle(event.detail === 0);
    const backpack = backpackButton();
    backpack.onclick = (event) => this.activeTab.backpack.toggle(event.detail === 0);
    box.prepend(marqueeButton(), bin, backpack);
    document.body.append(box);
    this.updateBinButton();
  }

  /** Updates the bin button's label with the number of entries. */
  private updateBinButton(): void {
    const count = this.activeTab.bin.size;
    const label = count ? t('Deleted blocks ({count})', {count}) : t('Deleted blocks');
    binButton().title = label;
    binButton().setAttribute('aria-label', label);
    binButton().classList.toggle('nepFull', count > 0);
  }
}

interface PictureRequest {
  token: number;
  kind: 'png' | 'svg';
  white: boolean;
}

interface InitialState {
  language: string;
  words: Record<string, string>;
  reduced: boolean;
  pinned: boolean | null;
  theme: {tokens: Tokens; dark: boolean};
}

/** Loads Blockly's messages in this language, otherwise in English; returns the language that was loaded. */
async function loadLocale(requested: string): Promise<string> {
  for (const language of new Set([requested, requested.split(/[-_]/)[0] ?? '', 'en'])) {
    // In our URL scheme a missing file is a failed request, not a response with a status.
    const response = await fetch(`msg/${encodeURIComponent(language.toLowerCase())}.json`).catch(() => null);
    if (!response?.ok) continue;
    Blockly.setLocale(await response.json() as Record<string, string>);
    return language;
  }
  throw new Error('no message catalogue of Blockly');
}

async function start(bridge: Bridge): Promise<void> {
  const initial = JSON.parse(await bridge.initial_settings()) as InitialState;
  useTokens(initial.theme.tokens, initial.theme.dark);
  setCssVariables(initial.theme.dark);
  document.documentElement.classList.toggle('reduced', initial.reduced);
  setTranslations(initial.words ?? {});
  const language = await loadLocale(initial.language);
  setBlocklyMessages(language);
  configureMenu();
  applyShortcutKeys();
  // Load the fonts first, because Blockly caches the width of text.
  const fonts = ['600 15px Inter', '500 14px Inter', ...(language === 'ja' ? ['600 15px "M PLUS 1p"'] : [])];
  await Promise.allSettled(fonts.map((font) => document.fonts.load(font)));
  const editor = new Editor(bridge, initial.pinned, initial.theme);
  trackInputModality();
  const inbox = new Inbox((name, payload) => {
    try {
      editor.receive(name, payload);
    } catch (error) {
      bridge.failed(`${name}: ${error instanceof Error ? error.message : String(error)}`);
    }
  });
  bridge.command_sent.connect((name, payload) => inbox.dispatch(name, payload));
  window.addEventListener('error', (event) => bridge.failed(event.message));
  window.addEventListener('unhandledrejection', (event) => bridge.failed(String(event.reason)));
  bridge.ready();
}

new QWebChannel(qt.webChannelTransport, (channel) => void start(channel.objects.bridge));
