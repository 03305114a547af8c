// Builds the block editor: `node build.mjs [folder]` (default: resources/blockly of the repository).
// The result is committed, so Studio needs no node; a test rebuilds it and compares.
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

/** The lines of an icon as one path: a page with a thousand blocks draws each shape by itself. Null: not only lines. */
function onePath(markup) {
  const parts = [];
  for (const [, tag, text] of markup.matchAll(/<(\w+)([^>]*?)\/?>/g)) {
    const given = Object.fromEntries([...text.matchAll(/([\w-]+)="([^"]*)"/g)].map(([, name, value]) => [name, value]));
    const {d, points, ...numbers} = given;
    const of = (name) => Number(numbers[name] ?? 0);
    const only = (...names) => Object.keys(numbers).every((name) => names.includes(name));
    const ring = (x, y, rx, ry) => `M${x - rx} ${y}a${rx} ${ry} 0 1 0 ${2 * rx} 0a${rx} ${ry} 0 1 0 ${-2 * rx} 0z`;
    if (tag === 'path' && only()) parts.push(d);
    else if (tag === 'line' && only('x1', 'y1', 'x2', 'y2')) parts.push(`M${of('x1')} ${of('y1')}L${of('x2')} ${of('y2')}`);
    else if (tag === 'polyline' && only()) parts.push(`M${points}`);
    else if (tag === 'polygon' && only()) parts.push(`M${points}z`);
    else if (tag === 'circle' && only('cx', 'cy', 'r')) parts.push(ring(of('cx'), of('cy'), of('r'), of('r')));
    else if (tag === 'ellipse' && only('cx', 'cy', 'rx', 'ry')) parts.push(ring(of('cx'), of('cy'), of('rx'), of('ry')));
    else if (tag === 'rect' && only('x', 'y', 'width', 'height', 'rx', 'ry')) parts.push(box(numbers, of));
    else return null;
  }
  return `<path d="${parts.map(absolute).join('')}"/>`;
}

/** Where a path begins, not counted from the end of the one before; the lines after it are still relative. */
function absolute(d) {
  const number = '-?(?:\\d+\\.?\\d*|\\.\\d+)';
  return d.trim().replace(new RegExp(`^m\\s*(${number})[\\s,]*(${number})[\\s,]*(?=([-.\\d])?)`),
    (_all, x, y, more) => `M${x} ${y}${more ? 'l' : ''}`);
}

function box(numbers, of) {
  const rx = Number(numbers.rx ?? numbers.ry ?? 0);
  const ry = Number(numbers.ry ?? numbers.rx ?? 0);
  const [w, h] = [of('width') - 2 * rx, of('height') - 2 * ry];
  const corner = (x, y) => rx ? `a${rx} ${ry} 0 0 1 ${x} ${y}` : '';
  return `M${of('x') + rx} ${of('y')}h${w}${corner(rx, ry)}v${h}${corner(-rx, ry)}h${-w}${corner(-rx, -ry)}v${-h}` +
    `${corner(rx, -ry)}z`;
}

/** The chosen Lucide icons as one object: name -> the markup inside its <svg>. */
async function icons() {
  const names = JSON.parse(await readFile(join(here, 'src', 'icon_names.json'), 'utf8'));
  const result = {};
  for (const name of [...names].sort()) {
    const svg = await readFile(join(modules, 'lucide-static', 'icons', `${name}.svg`), 'utf8');
    const inside = svg.slice(svg.indexOf('>', svg.indexOf('<svg')) + 1, svg.lastIndexOf('</svg>'));
    result[name] = onePath(inside) ?? inside.replace(/\s*\n\s*/g, '').replace(/ \/>/g, '/>');
  }
  return result;
}

const iconPlugin = {
  name: 'icons',
  setup(plugin) {
    plugin.onResolve({filter: /^virtual:icons$/}, () => ({path: 'icons', namespace: 'virtual'}));
    plugin.onLoad({filter: /.*/, namespace: 'virtual'}, async () => ({
      contents: JSON.stringify(await icons()), loader: 'json',
    }));
  },
};

async function legal() {
  const parts = [];
  for (const [name, file] of [['blockly', 'LICENSE'], ['lucide-static', 'LICENSE']]) {
    const about = JSON.parse(await readFile(join(modules, name, 'package.json'), 'utf8'));
    const text = await readFile(join(modules, name, file), 'utf8');
    parts.push(`${about.name} ${about.version} (${about.license})\n\n${text.trim()}\n`);
  }
  return `Third-party work inside this folder\n\n${parts.join('\n' + '-'.repeat(78) + '\n\n')}`;
}

async function messages(language) {
  const text = await readFile(join(modules, 'blockly', 'msg', `${language}.js`), 'utf8');
  const found = {};
  // The files assign `Blockly.Msg["KEY"] = "text";`, one a line.
  for (const match of text.matchAll(/Msg\["([A-Z0-9_a-z]+)"\]\s*=\s*("(?:[^"\\]|\\.)*");/g)) {
    found[match[1]] = JSON.parse(match[2]);
  }
  if (Object.keys(found).length < 100) throw new Error(`no messages found in ${language}.js`);
  return JSON.stringify(found, null, 0) + '\n';
}

async function fill(folder) {
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
    await writeFile(join(folder, 'msg', `${language}.json`), await messages(language));
  }
  await cp(join(here, 'src', 'index.html'), join(folder, 'index.html'));
  await cp(join(here, 'src', 'style.css'), join(folder, 'style.css'));
  await writeFile(join(folder, 'LEGAL.txt'), await legal());
}

// Built beside the target and put in its place when it is whole: a build that fails leaves the old one as it was.
await mkdir(target, {recursive: true});
const made = await mkdtemp(`${target}.new-`);
const before = `${made}.before`;
try {
  await fill(made);
  await chmod(made, 0o755);
  await rename(target, before);
  await rename(made, target).catch(async (error) => {
    await rename(before, target);
    throw error;
  });
} finally {
  await rm(made, {recursive: true, force: true});
}
await rm(before, {recursive: true, force: true});
