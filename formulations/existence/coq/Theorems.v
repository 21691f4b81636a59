(** The theorems. All words in them are defined in Definitions.v. build.sh states them again, in
    full, and compares what Coq prints of them and of their axioms with printed.txt. *)
From Coq Require Import Reals List Lia Lra Arith.
From Lockedjoint Require Import Definitions Bound Nonexistence Existence Negative.
Open Scope R_scope.

(** Nonexistence: no Jacobian of seven revolute joints is optimally failure-tolerant. *)
Theorem no_optimally_failure_tolerant_7R J s :
  revolute 7 J -> ~ optimally_failure_tolerant 7 J s.
Proof. exact (not_optimally_failure_tolerant_7R J s). Qed.

(** Eq. (6) of the paper for n > 6 joints of any kind *)
Theorem worst_case_at_most_bound n J t : (6 < n)%nat -> 0 < squared_norm n J ->
  worst_case_at_least n J t -> t <= bound n J.
Proof. exact (worst_case_bounded n J t). Qed.

(** It is attained by the optimally failure-tolerant Jacobians and by no others. *)
Theorem bound_attained_iff_optimal n J : (6 < n)%nat -> 0 < squared_norm n J ->
  worst_case_at_least n J (bound n J) <-> exists s, optimally_failure_tolerant n J s.
Proof. exact (attains_iff_optimal n J). Qed.

(** So the worst case of seven revolute joints is strictly below the bound. *)
Theorem worst_case_below_bound_7R J t :
  revolute 7 J -> worst_case_at_least 7 J t -> t < bound 7 J.
Proof.
  intros R T. assert (6 < 7)%nat as L by lia. assert (0 < 7)%nat as P by lia.
  pose proof (revolute_nonzero 7 J P R) as N.
  destruct (worst_case_bounded 7 J t L N T) as [G|E]; [exact G|]. exfalso. subst t.
  apply (attains_iff_optimal 7 J L N) in T as [s O].
  exact (no_optimally_failure_tolerant_7R J s R O).
Qed.

(** Existence: six joints more are always possible. *)
Theorem six_joints_more n : (0 < n)%nat -> exists_optimal n -> exists_optimal (n + 6).
Proof. exact (six_more n). Qed.

(** The classification: they exist for every n > 6 except 7. *)
Theorem exists_optimal_iff n : (6 < n)%nat -> exists_optimal n <-> n <> 7%nat.
Proof.
  intros L. split.
  - intros [J [s [R O]]] ->. exact (no_optimally_failure_tolerant_7R J s R O).
  - intros D. apply exists_from_8. lia.
Qed.
