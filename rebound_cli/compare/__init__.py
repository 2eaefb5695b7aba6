"""`rebound compare`: one mission flown by several laws, speeds and seeds; a table, a CSV and a page."""
