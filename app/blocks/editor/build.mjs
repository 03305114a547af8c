// Builds the block editor: `node build.mjs [folder]` (default: resources/blockly of the repository).
// The bundle is committed, so that Studio doesn't need Node.js; a test builds it again and compares.
import {build} from 'esbuild';
import {chmod, cp, mkdir, mkdtemp, readFile, rename, rm, writeFile} from 'node:fs/promises';
import {dirname, join, resolve} from 'node:path';
import {fileURLToPath} from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const target = resolve(process.argv[2] ?? join(here, '..', '..', '..', 'resources', 'blockly'));
const modules = join(here, 'node_modules');
const languages = ['en', 'de', 'es', 'fr', 'ja', 'pt-br'];
const media = ['sprites.svg', 'handclosed.cur', 'handdelete.cur', 'handopen.cur', 'dropdown-arrow.svg',
  'delete-icon.svg', 'foldout-icon.svg', 'resize-handle.svg', '1x1.gif'];

/**
 * Returns the icon as one path, because a page with a thousand blocks would draw each shape separately; null if the
 * icon has other elements or attributes.
 */
function mergeIntoPath(markup) {
  const parts = [];
  for (const [, tag, text] of markup.matchAll(/<(\w+)([^>]*?)\/?>/g)) {
    const attributes = Object.fromEntries([...text.matchAll(/([\w-]+)="([^"]*)"/g)].map(([, name, value]) => [name, value]));
    const {d, points, ...numbers} = attributes;
    const num = (name) => Number(numbers[name] ?? 0);
    const hasOnly = (...names) => Object.keys(numbers).every((name) => names.includes(name));
    const ellipsePath = (x, y, rx, ry) => `M${x - rx} ${y}a${rx} ${ry} 0 1 0 ${2 * rx} 0a${rx} ${ry} 0 1 0 ${-2 * rx} 0z`;
    if (tag === 'path' && hasOnly()) parts.push(d);
    else if (tag === 'line' && hasOnly('x1', 'y1', 'x2', 'y2')) parts.push(`M${num('x1')} ${num('y1')}L${num('x2')} ${num('y2')}`);
    else if (tag === 'polyline' && hasOnly()) parts.push(`M${points}`);
    else if (tag === 'polygon' && hasOnly()) parts.push(`M${points}z`);
    else if (tag === 'circle' && hasOnly('cx', 'cy', 'r')) parts.push(ellipsePath(num('cx'), num('cy'), num('r'), num('r')));
    else if (tag === 'ellipse' && hasOnly('cx', 'cy', 'rx', 'ry')) parts.push(ellipsePath(num('cx'), num('cy'), num('rx'), num('ry')));
    else if (tag === 'rect' && hasOnly('x', 'y', 'width', 'height', 'rx', 'ry')) parts.push(rectPath(numbers, num));
    else return null;
  }
  return `<path d="${parts.map(withAbsoluteStart).join('')}"/>`;
}

/** Makes the start of a path independent of the path before it; the lines after it stay relative. */
function withAbsoluteStart(d) {
  const number = '-?(?:\\d+\\.?\\d*|\\.\\d+)';
  return d.trim().replace(new RegExp(`^m\\s*(${number})[\\s,]*(${number})[\\s,]*(?=([-.\\d])?)`),
    (_all, x, y, more) => `M${x} ${y}${more ? 'l' : ''}`);
}

function rectPath(numbers, num) {
  const rx = Number(numbers.rx ?? numbers.ry ?? 0);
  const ry = Number(numbers.ry ?? numbers.rx ?? 0);
  const [w, h] = [num('width') - 2 * rx, num('height') - 2 * ry];
  const corner = (x, y) => rx ? `a${rx} ${ry} 0 0 1 ${x} ${y}` : '';
  return `M${num('x') + rx} ${num('y')}h${w}${corner(rx, ry)}v${h}${corner(-rx, ry)}h${-w}${corner(-rx, -ry)}v${-h}` +
    `${corner(rx, -ry)}z`;
}

/** Returns the Lucide icons in icon_names.json: the name and the markup inside its <svg>. */
async function readIcons() {
  const names = JSON.parse(await readFile(join(here, 'src', 'icon_names.json'), 'utf8'));
  const result = {};
  for (const name of [...names].sort()) {
    const svg = await readFile(join(modules, 'lucide-static', 'icons', `${name}.svg`), 'utf8');
    const inside = svg.slice(svg.indexOf('>', svg.indexOf('<svg')) + 1, svg.lastIndexOf('</svg>'));
    result[name] = mergeIntoPath(inside) ?? inside.replace(/\s*\n\s*/g, '').replace(/ \/>/g, '/>');
  }
  return result;
}

const iconPlugin = {
  name: 'icons',
  setup(plugin) {
    plugin.onResolve({filter: /^virtual:icons$/}, () => ({path: 'icons', namespace: 'virtual'}));
    plugin.onLoad({filter: /.*/, namespace: 'virtual'}, async () => ({
      contents: JSON.stringify(await readIcons()), loader: 'json',
    }));
  },
};

async function createLegalText() {
  const parts = [];
  for (const [name, file] of [['blockly', 'LICENSE'], ['lucide-static', 'LICENSE']]) {
    const packageInfo = JSON.parse(await readFile(join(modules, name, 'package.json'), 'utf8'));
    const text = await readFile(join(modules, name, file), 'utf8');
    parts.push(`${packageInfo.name} ${packageInfo.version} (${packageInfo.license})\n\n${text.trim()}\n`);
  }
  return `Third-party work inside this folder\n\n${parts.join('\n' + '-'.repeat(78) + '\n\n')}`;
}

async function readMessages(language) {
  const text = await readFile(join(modules, 'blockly', 'msg', `${language}.js`), 'utf8');
  const found = {};
  // The files contain one assignment `Blockly.Msg["KEY"] = "text";` per line.
  for (const match of text.matchAll(/Msg\["([A-Z0-9_a-z]+)"\]\s*=\s*("(?:[^"\\]|\\.)*");/g)) {
    found[match[1]] = JSON.parse(match[2]);
  }
  if (Object.keys(found).length < 100) throw new Error(`no messages found in ${language}.js`);
  return JSON.stringify(found, null, 0) + '\n';
}

async function buildInto(folder) {
  await build({
    entryPoints: [join(here, 'src', 'main.ts')],
    outfile: join(folder, 'editor.js'),
    bundle: true, minify: true, format: 'iife', target: 'chrome120', charset: 'utf8',
    legalComments: 'none', plugins: [iconPlugin], logLevel: 'warning',
  });
  await mkdir(join(folder, 'media'));
  for (const name of media) await cp(join(modules, 'blockly', 'media', name), join(folder, 'media', name));
  await mkdir(join(folder, 'msg'));
  for (const language of languages) {
    await writeFile(join(folder, 'msg', `${language}.json`), await readMessages(language));
  }
  await cp(join(here, 'src', 'index.html'), join(folder, 'index.html'));
  await cp(join(here, 'src', 'style.css'), join(folder, 'style.css'));
  await writeFile(join(folder, 'LEGAL.txt'), await createLegalText());
}

// Built in a new folder that replaces the target at the end: a failed build leaves the old bundle unchanged.
await mkdir(target, {recursive: true});
const newFolder = await mkdtemp(`${target}.new-`);
const oldFolder = `${newFolder}.before`;
try {
  await buildInto(newFolder);
  await chmod(newFolder, 0o755);
  await rename(target, oldFolder);
  await rename(newFolder, target).catch(async (error) => {
    await rename(oldFolder, target);
    throw error;
  });
} finally {
  await rm(newFolder, {recursive: true, force: true});
}
await rm(oldFolder, {recursive: true, force: true});
