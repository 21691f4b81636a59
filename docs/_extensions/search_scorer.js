// What a search shows first: the curated reference, then pages that people wrote, then modules.
var Scorer = {
  score: function (result) {
    var page = result[0], points = result[4];
    if (page === "reference/library") return points + 60;
    if (page.indexOf("reference/nlp/") === 0 || page.indexOf("reference/formulations/") === 0) return points - 20;
    return points;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
