"""Laws that are in no catalogue: a grammar of forms, screened on one table, then searched like effects."""
