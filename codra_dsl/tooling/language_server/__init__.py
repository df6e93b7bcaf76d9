"""The language server: findings, names and places of specs for editors, over the Language Server Protocol (LSP).

`server` connects the protocol to the functions of the other modules. `projects` lints the specs of a project with the
texts of open documents; `documents` converts positions; `index` lists the declarations and uses of names.
"""
