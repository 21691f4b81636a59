(** The certificate passes the check, so no optimally failure-tolerant 7R Jacobian exists.
    This is the one long computation, 5 s in the virtual machine of Coq's kernel. *)
From Coq Require Import Reals ZArith List Lia.
From Lockedjoint Require Import Definitions Sums Checker Soundness Reduction Data.
Open Scope R_scope.

Lemma proof_checks : check proof = true.
Proof. vm_cast_no_check (eq_refl true). Qed.

Theorem no_solution W : ~ solution W.
Proof. intros S. exact (check_sound W S proof proof_checks). Qed.

Theorem not_optimally_failure_tolerant_7R J s : revolute 7 J -> ~ optimally_failure_tolerant 7 J s.
Proof. intros R O. exact (no_solution _ (W_solution J s R O)). Qed.
