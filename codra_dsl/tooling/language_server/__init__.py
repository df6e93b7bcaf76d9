"""The language server: findings, names and completion for editors, over the Language Server Protocol (LSP).

`methods` connects the protocol to `server`, which has the open documents and decides when to lint. `projects` lints a
project with the texts of open documents. `documents` converts positions. `index` has the declarations and uses of
names, and `other_files` those in sites and timelines; `describing`, `completion` and `renaming` answer from them.
"""
