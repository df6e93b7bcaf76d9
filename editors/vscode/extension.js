"use strict";

const { commands, languages, window, workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

/** The client while the server runs or starts, else undefined. */
let client;

/** The changes of the client, one after the other: settings may change while the server starts. */
let pending = Promise.resolve();

/** Return the YAML documents for which the server is responsible: those at the patterns of the settings. */
function documentSelector() {
  const patterns = workspace.getConfiguration("codra").get("files");
  return patterns.map((pattern) => ({ scheme: "file", language: "yaml", pattern }));
}

function isOurs(document) {
  return languages.match(documentSelector(), document) > 0;
}

async function start() {
  if (client || !workspace.textDocuments.some(isOurs)) {
    return;
  }
  const command = workspace.getConfiguration("codra").get("path");
  client = new LanguageClient(
    "codra",
    "CoDRA",
    { command, args: ["language-server"] },
    { documentSelector: documentSelector() }, // the server itself asks for reports of changed files
  );
  try {
    await client.start();
  } catch {
    window.showErrorMessage(
      `CoDRA: '${command} language-server' did not start. Install 'codra-dsl[editor]', or set 'codra.path' to its program.`,
    );
  }
}

async function stop() {
  const running = client;
  client = undefined;
  await running?.dispose().catch(() => {}); // it may not have started
}

function enqueue(...steps) {
  for (const step of steps) {
    pending = pending.then(step);
  }
  return pending;
}

/** Start the server as soon as one of its documents is open, and again when its settings change. */
function activate(context) {
  context.subscriptions.push(
    workspace.onDidOpenTextDocument((document) => isOurs(document) && enqueue(start)),
    workspace.onDidChangeConfiguration(
      (event) =>
        (event.affectsConfiguration("codra.path") || event.affectsConfiguration("codra.files")) && enqueue(stop, start),
    ),
    commands.registerCommand("codra.restart", () => enqueue(stop, start)),
  );
  return enqueue(start);
}

function deactivate() {
  return enqueue(stop);
}

module.exports = { activate, deactivate };
