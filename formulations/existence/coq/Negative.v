(** Certificates that prove nothing are refused: the check is not always true. *)
From Coq Require Import List ZArith.
From Lockedjoint Require Import Checker Data.
Import ListNotations.
Open Scope Z_scope.

(** The committed certificate with another constant, and without its first multiplier *)
Lemma other_constant :
  check (Certificate (constant proof + 1) (squares proof) (multipliers proof)) = false.
Proof. vm_cast_no_check (eq_refl false). Qed.

Lemma missing_multiplier :
  check (Certificate (constant proof) (squares proof) (tl (multipliers proof))) = false.
Proof. vm_cast_no_check (eq_refl false). Qed.

(** True identities that contradict nothing: 0 = 0, and 1 - |1|^2 = 0 *)
Lemma no_constant : check (Certificate 0 [] []) = false.
Proof. reflexivity. Qed.

Lemma negative_weight : check (Certificate 1 [(-1, [(1, one)])] []) = false.
Proof. reflexivity. Qed.

(** Equations and monomials of an eighth joint *)
Lemma eighth_joint : forall e, In e [RowSum 7; Square 0 7; TightFrame 7 0] -> well_formed e = false.
Proof. intros e [<-|[<-|[<-|[]]]]; reflexivity. Qed.
