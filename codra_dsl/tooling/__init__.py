"""Tools that read compiled specifications: reports, comparisons, new projects."""
