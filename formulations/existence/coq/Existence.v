(** Optimally failure-tolerant Jacobians that do exist: an exact one with six joints, and with
    it one of n + 6 joints for every one of n joints. *)
From Coq Require Import Reals List Lia Lra Arith.
From Lockedjoint Require Import Definitions Sums Reduction.
Import ListNotations.
Open Scope R_scope.

Definition exists_optimal (n : nat) := exists J s, revolute n J /\ optimally_failure_tolerant n J s.

(** The columns (v; omega) are (e2; e1), (e3; e2), (e1; e3), and the same with -v. *)
Definition six (a i : nat) : R :=
  match i, a with
  | 0%nat, 1%nat | 1%nat, 2%nat | 2%nat, 0%nat => 1
  | 3%nat, 1%nat | 4%nat, 2%nat | 5%nat, 0%nat => -1
  | 0%nat, 3%nat | 1%nat, 4%nat | 2%nat, 5%nat | 3%nat, 3%nat | 4%nat, 4%nat | 5%nat, 5%nat => 1
  | _, _ => 0
  end.

Theorem six_optimal : revolute 6 six /\ optimally_failure_tolerant 6 six 2.
Proof.
  split; split.
  1-2: intros [|[|[|[|[|[|i]]]]]] I; try lia; simpl; ring.
  - intros [|[|[|[|[|[|a]]]]]] [|[|[|[|[|[|b]]]]]] A B; try lia; unfold delta; simpl; ring.
  - intros [|[|[|[|[|[|i]]]]]] [|[|[|[|[|[|j]]]]]] I K; try lia; unfold dot, column; simpl; ring.
Qed.

(** Two arms side by side *)
Definition beside (n : nat) (J K : nat -> nat -> R) (a i : nat) : R :=
  if Nat.ltb i n then J a i else K a (i - n)%nat.

Lemma sum_beside n m f g :
  sum (seq 0 (n + m)) (fun i => if Nat.ltb i n then f i else g (i - n)%nat) = sum (seq 0 n) f + sum (seq 0 m) g.
Proof.
  induction m as [|m IH].
  - rewrite Nat.add_0_r. simpl. rewrite Rplus_0_r. apply seq_ext; intros i I.
    apply Nat.ltb_lt in I. rewrite I. reflexivity.
  - rewrite <- plus_n_Sm, !sum_S, IH. assert (Nat.ltb (n + m) n = false) as -> by (apply Nat.ltb_ge; lia).
    replace (n + m - n)%nat with m by lia. ring.
Qed.

Theorem beside_optimal n m J K s r : (0 < n)%nat -> (0 < m)%nat ->
  revolute n J -> optimally_failure_tolerant n J s ->
  revolute m K -> optimally_failure_tolerant m K r ->
  revolute (n + m) (beside n J K) /\ optimally_failure_tolerant (n + m) (beside n J K) (s + r).
Proof.
  intros N M RJ OJ RK OK. unfold beside. split; split.
  - intros i I. destruct (Nat.ltb_spec i n); [apply (unit_axes _ _ RJ)|apply (unit_axes _ _ RK)]; lia.
  - intros i I. destruct (Nat.ltb_spec i n); [apply (orthogonal _ _ RJ)|apply (orthogonal _ _ RK)]; lia.
  - intros a b A B.
    rewrite (sum_ext _ _ (fun i => if Nat.ltb i n then J a i * J b i else K a (i - n)%nat * K b (i - n)%nat))
      by (intros i _; destruct (Nat.ltb i n); reflexivity).
    rewrite (sum_beside n m (fun i => J a i * J b i) (fun i => K a i * K b i)),
      (isotropic _ _ _ OJ), (isotropic _ _ _ OK) by assumption. ring.
  - assert (forall i, (i < n + m)%nat ->
      dot 6 (column (fun a i => if Nat.ltb i n then J a i else K a (i - n)%nat) i)
            (column (fun a i => if Nat.ltb i n then J a i else K a (i - n)%nat) i) = 2) as E.
    { intros i I. unfold column. destruct (Nat.ltb_spec i n).
      - apply (column_norms n J s RJ OJ i); lia.
      - apply (column_norms m K r RK OK (i - n)); lia. }
    intros i j I L. rewrite !E by assumption. reflexivity.
Qed.

Theorem sum_exists n m : (0 < n)%nat -> (0 < m)%nat ->
  exists_optimal n -> exists_optimal m -> exists_optimal (n + m).
Proof.
  intros N M [J [s [RJ OJ]]] [K [r [RK OK]]]. exists (beside n J K), (s + r).
  apply beside_optimal; assumption.
Qed.

Theorem six_more n : (0 < n)%nat -> exists_optimal n -> exists_optimal (n + 6).
Proof.
  intros N E. apply sum_exists; [assumption|lia|assumption|]. exists six, 2. exact six_optimal.
Qed.
