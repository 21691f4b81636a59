// How the search ranks pages. Sphinx's own scores, and then: pages for users come before proofs,
// tables of results and the pages of modules.
const INTERNAL = /^(reference\/modules\/|results\/|bounds$|several_failures$|atlas_proofs$|nonexistence$|existence$)/;
const USERS = /^(start|installation|faq|glossary|formulations|robots\/|howto\/|reference\/(commands|library)$)/;

var Scorer = {
  score: ([docname, , , , score]) =>
    score + (INTERNAL.test(docname) ? -25 : 0) + (USERS.test(docname) ? 10 : 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
