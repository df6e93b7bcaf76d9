"""Which values can satisfy a condition: intervals, cases, linear sums."""
