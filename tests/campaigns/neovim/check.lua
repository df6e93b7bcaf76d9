-- Run in Neovim with a spec open: write what the user sees to the file $CODRA_SEEN, as JSON, and quit.
local seen = {}

local function wait(condition)
  return vim.wait(100000, condition, 20)
end

local function findings()
  local shown = {}
  for _, finding in ipairs(vim.diagnostic.get(0)) do
    local text = vim.api.nvim_buf_get_lines(0, finding.lnum, finding.lnum + 1, true)[1]
    table.insert(shown, { text = text:sub(finding.col + 1, finding.end_col), message = finding.message })
  end
  return shown
end

wait(function() return #vim.diagnostic.get(0) > 0 end)
seen.before = findings()

-- Mend the mistake without saving it.
vim.cmd("%s/door_opn/door_open/")
wait(function() return #vim.diagnostic.get(0) == 0 end)
seen.after = findings()

vim.fn.search("door_open")
vim.cmd("normal gd")
wait(function() return vim.fn.expand("%:t") == "door.yaml" end)
seen.definition = { file = vim.fn.expand("%:t"), line = vim.api.nvim_get_current_line() }

vim.fn.writefile({ vim.fn.json_encode(seen) }, os.getenv("CODRA_SEEN"))
vim.cmd("qall!")
