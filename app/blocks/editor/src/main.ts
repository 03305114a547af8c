// Page of the block editor: handles messages from the window (`nepReceive`) and sends messages to it.
import * as Blockly from 'blockly/core';
import './blockly_patches';
import './fields';
import './focus_after_delete';
import './mutators';
import {setBlocklyMessages} from './blockly_words';
import './near';
import './number_field';
import {backpackButton, registerBackpack, setBackpackContents} from './backpack';
import {CrossTabDrag} from './carrying';
import {type Bridge, connect, rejectUnhandled, send} from './channel';
import {Clipboard} from './clipboard';
import {EmptyCanvas, BlockPointer} from './guidance';
import {binButton} from './bin';
import {selectAll, marqueeButton} from './frame';
import {HelpCard, focusedBlock, registerHelpMenu} from './help';
import {Inbox} from './inbox';
import {iconElement} from './icons';
import {registerClipboardShortcuts, applyShortcutKeys} from './keys';
import {registerMenu, registerPictureMenu, configureMenu} from './menu';
import type {EditSelection, EditorTheme, LayOutPages, RenderPicture, RunCommand, ShowTab, StartEditor, WindowMessage} from './messages';
import {renderPng, createPicture} from './picture';
import {clearPages, layoutPages} from './print';
import {FindBar} from './search';
import {trackInputModality, setKeyboardLed} from './modality';
import {type Tab} from './tab';
import {type Definitions, Tabs} from './tabs';
import {setCssVariables} from './theme';
import {type Tokens, useTokens} from './tokens';
import {showAlarms} from './toolbox';
import {registerVariableMenu} from './variable_edits';
import {TryResult, registerTries} from './tries';
import {t, setTranslations} from './words';

declare const QWebChannel: new (transport: unknown, callback: (channel: {objects: {bridge: Bridge}}) => void) => unknown;
declare const qt: {webChannelTransport: unknown};

class Editor {
  private readonly tabs: Tabs;
  private readonly help = new HelpCard();
  private readonly clipboard = new Clipboard();
  private readonly tryAnswer = new TryResult();
  private readonly carrying = new CrossTabDrag(() => this.activeTab);
  private offered = '[]';
  private watched = '[]';
  private readonly find = new FindBar(() => this.activeTab.workspace);
  private readonly pointer = new BlockPointer(() => this.activeTab.workspace);
  private readonly empty = new EmptyCanvas(() => this.activeTab.workspace, this.pointer);

  constructor(isPinned: boolean | null, private theme: EditorTheme) {
    const isActive = (tab: Tab) => tab === this.tabs?.activeTab;
    const ifActive = (tab: Tab, notify: () => void) => {
      if (isActive(tab)) notify();
    };
    this.tabs = new Tabs(document.getElementById('workspace')!, {
      isActive,
      edited: () => this.find.refresh(),
      offered: (tab) => ifActive(tab, () => this.notifyOfferedSensors()),
      watched: (tab) => ifActive(tab, () => this.notifyWatched()),
      made: (tab) => this.empty.watch(tab.workspace),
      pinned: (isPinned) => {
        send({type: 'flyoutPinned', isPinned});
        this.tabs.setPinned(isPinned);
      },
      binned: (tab) => ifActive(tab, () => this.updateBinButton()),
      outside: (mouse, items) => this.carrying.trackOutside(mouse, items),
      dragEnded: (isPlaced, isCopy) => this.carrying.dragEnded(isPlaced, isCopy),
      droppedOutside: (tab, drag, mouse) => this.carrying.dropOutside(tab, drag, mouse),
    });
    this.tabs.setPinned(isPinned);
    // Don't resize for printing, which changes the size of the page temporarily.
    new ResizeObserver(() => window.matchMedia('print').matches || this.tabs.resize()).observe(document.body);
    // A hidden page has no animation frames, and Blockly fires events only after a frame.
    document.addEventListener('visibilitychange', () => document.hidden && this.activeTab.program.flush());
    this.createZoomButtons();
    registerTries();
    registerHelpMenu((block) => this.help.show(block));
    registerClipboardShortcuts(this.clipboard);
    registerMenu(this.clipboard);
    registerBackpack(() => this.activeTab.backpack);
    registerPictureMenu();
    // Send shortcuts to the canvas if no element has the focus, such as after a tab switch.
    document.addEventListener('keydown', (event) => {
      if (document.activeElement !== document.body || !(event.ctrlKey || event.metaKey)) return;
      Blockly.ShortcutRegistry.registry.onKeyDown(this.activeTab.workspace, event);
    });
    registerVariableMenu((id) => this.activeTab.watched.isWatched(id));
    let wasOnBlock = false;
    const notifyFocusedBlock = () => queueMicrotask(() => {
      const isFocused = focusedBlock() !== null;
      if (isFocused !== wasOnBlock) send({type: 'blockFocusChanged', isFocused: wasOnBlock = isFocused});
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

  receive(message: WindowMessage): void {
    const {activeTab} = this;
    switch (message.type) {
      case 'startEditor': return;  // handled in `start`
      case 'setTheme': return this.setTheme(message.theme);
      case 'setReducedMotion': return setReducedMotion(message.isReduced);
      case 'setDefinitions': return this.tabs.define(message.definitions as Definitions);
      case 'showTab': return this.showTab(message);
      case 'closeTab': return this.tabs.close(message.key);
      case 'pinFlyout': return this.tabs.setPinned(message.isPinned);
      case 'highlightBlocks': return activeTab.overlays.highlight(message.ids);
      case 'markStopped': return activeTab.overlays.markStopped(message.ids);
      case 'setAbsent': return activeTab.overlays.setAbsent(message.ids);
      case 'setBlockErrors': return this.setErrors(message.errors);
      case 'setBlockWarnings': return activeTab.overlays.setWarnings(message.warnings);
      case 'showValue': return this.showMessageBeside(message.id, message.text, false);
      case 'setVariableValues': return activeTab.watched.updateValues(message.values);
      case 'setLiveValues': return activeTab.overlays.setLive(message.values, message.staleKeys);
      case 'setAlarms': return showAlarms(message.alarms);
      case 'editVariable': return activeTab.editVariable(message.edit);
      case 'flushWorkspace':
        return send({type: 'workspaceFlushed', token: message.token, workspace: activeTab.program.flush()});
      case 'renderPicture': return void this.sendPicture(message);
      case 'layOutPages': return this.layOutPages(message);
      case 'applyEdit': return activeTab.change(message.workspace);
      case 'setBackpack': return setBackpackContents(message.items);
      case 'clipboardText': return this.clipboard.receive(message.text);
      case 'zoom': return activeTab.workspace.zoomCenter(message.steps);
      case 'revealBlock': return activeTab.reveal(message.id);
      case 'editSelection': return this.editSelection(message.command);
      case 'setCanvasHint': return this.empty.setHint(message);
      case 'pointAt': return this.pointer.show(message.target);
      case 'runCommand': return this.run(message.command);
      default: return rejectUnhandled(message);
    }
  }

  private get activeTab(): Tab {
    return this.tabs.activeTab;
  }

  private run(command: RunCommand['command']): void {
    const {activeTab} = this;
    switch (command) {
      case 'undo': return activeTab.program.undo(false);
      case 'redo': return activeTab.program.undo(true);
      case 'undoDeletion':
        if (activeTab.bin.undoLast()) activeTab.program.undo(false);
        return;
      case 'dropBlocks': return this.carrying.dropInto(activeTab);
      case 'undoDrop': return this.carrying.undoDrop();
      case 'fit': return activeTab.fit();
      case 'help': return void this.help.show(focusedBlock());
      case 'showFocus': return setKeyboardLed(true);
      case 'clearPages': return clearPages();
      case 'find':
        this.find.open();
        return send({type: 'fieldOpened'});
      case 'search':
        activeTab.search();
        return send({type: 'fieldOpened'});
      default: return rejectUnhandled(command);
    }
  }

  private editSelection(command: EditSelection['command']): void {
    // The command can arrive before the page gets the focus; until then, Blockly has no selected block.
    if (!this.activeTab.hasFocus || !Blockly.getFocusManager().getFocusedNode()) this.activeTab.focus();
    if (command === 'selectAll') selectAll(this.activeTab.workspace);
    else void this.clipboard[command]();
  }

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

  private showTab(tab: ShowTab): void {
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
    const {ids} = this.activeTab.watched;
    const watched = JSON.stringify(ids);
    if (watched === this.watched) return;
    this.watched = watched;
    send({type: 'variablesWatched', ids});
  }

  /** Requests the values of the sensors shown in the toolbox from the window. */
  private notifyOfferedSensors(): void {
    const sensors = this.activeTab.offered;
    const offered = JSON.stringify(sensors);
    if (offered === this.offered) return;
    this.offered = offered;
    send({type: 'sensorsShown', sensors});
  }

  /** Runs `draw` with the light theme. */
  private withLightTheme<T>(draw: () => T): T {
    const {theme} = this;
    if (theme.isDark) this.setTheme({...theme, isDark: false});  // never visible: the theme is restored before the next paint
    try {
      return draw();
    } finally {
      if (theme.isDark) this.setTheme(theme);
    }
  }

  private layOutPages(paper: LayOutPages): void {
    let count = 0;
    try {
      count = this.withLightTheme(() => layoutPages(this.activeTab.workspace, paper));
    } finally {
      send({type: 'pagesLaidOut', token: paper.token, count});
    }
  }

  private async sendPicture({token, kind, isWhite}: RenderPicture): Promise<void> {
    let data = '';
    try {
      const picture = await this.withLightTheme(() => createPicture(this.activeTab.workspace, isWhite));
      if (picture) data = kind === 'svg' ? picture.svg : await renderPng(picture);
    } finally {
      send(kind === 'svg' ? {type: 'svgRendered', token, svg: data} : {type: 'pngRendered', token, png: data});
    }
  }

  private setTheme(theme: EditorTheme): void {
    this.theme = theme;
    applyTheme(theme);
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

function applyTheme({tokens, isDark}: EditorTheme): void {
  useTokens(tokens as unknown as Tokens, isDark);
  setCssVariables(isDark);
}

function setReducedMotion(isReduced: boolean): void {
  document.documentElement.classList.toggle('reduced', isReduced);
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

async function createEditor(initial: StartEditor): Promise<Editor> {
  applyTheme(initial.theme);
  setReducedMotion(initial.isMotionReduced);
  setTranslations(initial.words);
  const language = await loadLocale(initial.language);
  setBlocklyMessages(language);
  configureMenu();
  applyShortcutKeys();
  // Load the fonts first, because Blockly caches the width of text.
  const fonts = ['600 15px Inter', '500 14px Inter', ...(language === 'ja' ? ['600 15px "M PLUS 1p"'] : [])];
  await Promise.allSettled(fonts.map((font) => document.fonts.load(font)));
  const editor = new Editor(initial.isPinned, initial.theme);
  trackInputModality();
  return editor;
}

async function start(bridge: Bridge): Promise<void> {
  let receiveFirst: (message: WindowMessage) => void = () => undefined;
  const first = new Promise<WindowMessage>((resolve) => receiveFirst = resolve);
  let inbox: Inbox | null = null;
  connect(bridge, (json) => {
    const message = JSON.parse(json) as WindowMessage;
    if (inbox) inbox.dispatch(message, json.length);
    else receiveFirst(message);
  });
  send({type: 'pageOpened'});
  const message = await first;
  if (message.type !== 'startEditor') throw new Error(`expected startEditor, not ${message.type}`);
  const editor = await createEditor(message);
  inbox = new Inbox((received) => {
    try {
      editor.receive(received);
    } catch (error) {
      send({type: 'pageFailed', text: `${received.type}: ${error instanceof Error ? error.message : String(error)}`});
    }
  });
  window.addEventListener('error', (event) => send({type: 'pageFailed', text: event.message}));
  window.addEventListener('unhandledrejection', (event) => send({type: 'pageFailed', text: String(event.reason)}));
  send({type: 'pageReady'});
}

new QWebChannel(qt.webChannelTransport, (channel) => void start(channel.objects.bridge));
