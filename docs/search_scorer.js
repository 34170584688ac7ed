// SPDX-License-Identifier: BSD-3-Clause
//
// Scores of search results: those of Sphinx, but pages about the project come after the guides.
var Scorer = {
  score: ([page, , , , score]) =>
    /decisions\/|CHANGELOG|QUALITY_DECLARATION|benchmarks\//.test(page) ? score - 11 : score,
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
