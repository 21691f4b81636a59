(** From an optimally failure-tolerant Jacobian of seven revolute joints to a solution W:
    [W_solution]. *)
From Coq Require Import Reals ZArith List Permutation Bool Lia Lra Ring Arith.
From Lockedjoint Require Import Definitions Sums Checker Soundness.
Import ListNotations.
Open Scope R_scope.

(** For any number of revolute joints, s = n/3 and every column has the squared norm 2. *)
Section Scale.
Variable n : nat.
Variable J : nat -> nat -> R.
Variable s : R.
Hypothesis rev : revolute n J.
Hypothesis opt : optimally_failure_tolerant n J s.

Lemma scale : INR n = 3 * s.
Proof.
  assert (sum (seq 0 3) (fun k => sum (seq 0 n) (fun i => J (3 + k)%nat i * J (3 + k)%nat i)) = INR n) as E.
  { rewrite sum_swap, (seq_ext n _ (fun _ => 1)), sum_const, seq_length; [ring|].
    apply (unit_axes _ _ rev). }
  rewrite <- E, (seq_ext 3 _ (fun _ => s)), sum_const; [simpl; ring|].
  intros k K. rewrite (isotropic _ _ _ opt), delta_refl by lia. ring.
Qed.

Lemma column_norms i : (i < n)%nat -> dot 6 (column J i) (column J i) = 2.
Proof.
  intros I.
  assert (sum (seq 0 6) (fun a => sum (seq 0 n) (fun j => J a j * J a j)) = 6 * s) as E.
  { rewrite (seq_ext 6 _ (fun _ => s)), sum_const; [simpl; ring|].
    intros a A. rewrite (isotropic _ _ _ opt), delta_refl by lia. ring. }
  rewrite sum_swap, (seq_ext n _ (fun _ => dot 6 (column J i) (column J i))), sum_const, seq_length in E.
  - assert (0 < INR n) by (apply lt_0_INR; lia). apply (Rmult_eq_reg_l (INR n)); [|lra].
    rewrite E. pose proof scale. lra.
  - intros j K. apply (equal_norms _ _ _ opt); lia.
Qed.
End Scale.

Section Reduction.
Variable J : nat -> nat -> R.
Variable s : R.
Hypothesis rev : revolute 7 J.
Hypothesis opt : optimally_failure_tolerant 7 J s.

Lemma s_value : s = 7 / 3.
Proof. pose proof (scale 7 J s rev opt) as E. simpl in E. lra. Qed.

Definition gram i j := sum (seq 0 6) (fun a => J a i * J a j).

Lemma norms i : (i < 7)%nat -> gram i i = 2.
Proof. exact (column_norms 7 J s rev opt i). Qed.

Lemma gram_sym i j : gram i j = gram j i.
Proof. apply sum_ext; intros; ring. Qed.

Lemma gram_square i j : sum joints (fun k => gram i k * gram k j) = s * gram i j.
Proof.
  unfold gram. rewrite sum_mul_swap, <- sum_scale. apply sum_ext; intros a A. apply in_seq in A.
  rewrite (sum_ext _ _ (fun b => delta a b * (s * J a i * J b j))).
  - rewrite (sum_delta 6 a (fun b => s * J a i * J b j)) by lia. ring.
  - intros b B. apply in_seq in B.
    rewrite (sum_ext _ _ (fun k => (J a i * J b j) * (J a k * J b k))) by (intros; ring).
    rewrite sum_scale. unfold joints. rewrite (isotropic _ _ _ opt) by lia. ring.
Qed.

(** The projector on the null space of J *)
Definition projector i j := delta i j - 3 / 7 * gram i j.

Lemma projector_sym i j : projector i j = projector j i.
Proof. unfold projector. rewrite delta_sym, gram_sym. reflexivity. Qed.

Lemma projector_diagonal i : (i < 7)%nat -> projector i i = 1 / 7.
Proof. intros I. unfold projector. rewrite delta_refl, norms by assumption. lra. Qed.

Lemma projector_square i j : (i < 7)%nat -> (j < 7)%nat -> sum joints (fun k => projector i k * projector j k) = projector i j.
Proof.
  intros I K. unfold projector.
  rewrite (sum_ext _ _ (fun k => delta i k * delta j k + ((-3 / 7) * (delta i k * gram j k)
    + ((-3 / 7) * (delta j k * gram i k) + 9 / 49 * (gram i k * gram k j))))).
  2:{ intros k _. rewrite (gram_sym k j). field. }
  rewrite !sum_add, !sum_scale, gram_square. unfold joints.
  rewrite !sum_delta by assumption. rewrite s_value, (gram_sym j i), (delta_sym j i). field.
Qed.

Lemma projector_difference i j c : (i < 7)%nat -> (j < 7)%nat ->
  sum joints (fun k => (projector i k - c * projector j k) * (projector i k - c * projector j k)) = 1 / 7 - 2 * c * projector i j + c * c / 7.
Proof.
  intros I K.
  rewrite (sum_ext _ _ (fun k => projector i k * projector i k + ((- 2 * c) * (projector i k * projector j k)
    + c * c * (projector j k * projector j k)))) by (intros; ring).
  rewrite !sum_add, !sum_scale, !projector_square, !projector_diagonal by assumption. field.
Qed.

Lemma projector_bound i j : (i < 7)%nat -> (j < 7)%nat -> projector i j * projector i j <= 1 / 49.
Proof.
  intros I K.
  assert (forall c, 0 <= 1 / 7 - 2 * c * projector i j + c * c / 7) as N.
  { intros c. rewrite <- projector_difference by assumption. apply sum_nonneg; intros. apply Rle_0_sqr. }
  pose proof (N 1). pose proof (N (-1)).
  assert (0 <= (1 / 7 - projector i j) * (1 / 7 + projector i j)) by (apply Rmult_le_pos; lra). lra.
Qed.

Lemma projector_modulus i j : (i < 7)%nat -> (j < 7)%nat -> projector i j * projector i j = 1 / 49.
Proof.
  intros I K. cut (1 / 49 - projector i j * projector i j = 0); [lra|].
  apply (sum_zero_each joints (fun k => 1 / 49 - projector i k * projector i k)).
  - intros k signed. apply in_joints in signed. pose proof (projector_bound i k I signed). lra.
  - rewrite (sum_ext _ _ (fun k => 1 / 49 + (-1) * (projector i k * projector i k))) by (intros; ring).
    rewrite sum_add, sum_scale, projector_square, projector_diagonal, sum_const by assumption.
    simpl. lra.
  - apply in_joints, K.
Qed.

(** Signs of the columns *)
Definition sign i := 7 * projector 0 i.

Lemma sign_square i : (i < 7)%nat -> sign i * sign i = 1.
Proof. intros I. unfold sign. assert (0 < 7)%nat as O by lia. pose proof (projector_modulus 0 i O I). lra. Qed.

Lemma projector_rank_one i k : (i < 7)%nat -> (k < 7)%nat -> projector i k = sign i * sign k / 7.
Proof.
  intros I K. assert (0 < 7)%nat as O by lia.
  pose proof (projector_difference i 0 (sign i) I O) as D.
  assert (2 * sign i * projector i 0 = 2 / 7 * (sign i * sign i)) as E by (rewrite (projector_sym i 0); unfold sign; field).
  rewrite E, sign_square in D by assumption.
  assert ((projector i k - sign i * projector 0 k) * (projector i k - sign i * projector 0 k) = 0) as F.
  { apply (sum_zero_each joints (fun k => (projector i k - sign i * projector 0 k) * (projector i k - sign i * projector 0 k))).
    - intros; apply Rle_0_sqr.
    - rewrite D. lra.
    - apply in_joints, K. }
  apply Rsqr_0_uniq in F. unfold sign at 2. lra.
Qed.

Definition signed a i := J a i * sign i.

Lemma signed_rows a b : (a < 6)%nat -> (b < 6)%nat -> sum joints (fun k => signed a k * signed b k) = 7 / 3 * delta a b.
Proof.
  intros A B. rewrite <- s_value, <- (isotropic _ _ _ opt a b A B). apply sum_ext; intros k K.
  apply in_joints, sign_square in K. unfold signed.
  transitivity (J a k * J b k * (sign k * sign k)); [ring|]. rewrite K. ring.
Qed.

Lemma signed_columns i j : (i < 7)%nat -> (j < 7)%nat ->
  sum (seq 0 6) (fun a => signed a i * signed a j) = 7 / 3 * (delta i j - 1 / 7).
Proof.
  intros I K. unfold signed.
  rewrite (sum_ext _ _ (fun a => (sign i * sign j) * (J a i * J a j))) by (intros; ring).
  rewrite sum_scale. fold (gram i j).
  replace (gram i j) with (7 / 3 * (delta i j - projector i j)) by (unfold projector; field).
  rewrite projector_rank_one by assumption. unfold delta. destruct (Nat.eqb_spec i j) as [->|_].
  - rewrite sign_square by assumption. field.
  - transitivity (7 / 3 * (0 - (sign i * sign i) * (sign j * sign j) / 7)); [field|].
    rewrite !sign_square by assumption. field.
Qed.

Lemma signed_null a : (a < 6)%nat -> sum joints (signed a) = 0.
Proof.
  intros A. cut (sum joints (signed a) * sum joints (signed a) = 0); [apply Rsqr_0_uniq|].
  apply (sum_zero_each (seq 0 6) (fun a => sum joints (signed a) * sum joints (signed a))).
  - intros; apply Rle_0_sqr.
  - etransitivity; [apply (sum_mul_swap (seq 0 6) joints joints (fun i a => signed a i) (fun j a => signed a j))|].
    rewrite (sum_ext _ _ (fun _ => 0)); [rewrite sum_const; ring|].
    intros i I. apply in_joints in I.
    rewrite (sum_ext _ _ (fun j => delta i j * (7 / 3) + - (1 / 3))).
    + rewrite sum_add. unfold joints. rewrite (sum_delta 7 i (fun _ => 7 / 3)), sum_const by assumption.
      simpl. lra.
    + intros j K. apply in_joints in K. rewrite signed_columns by assumption. field.
  - apply in_seq. lia.
Qed.

Definition z (a i : nat) : C := mkC (signed a i) (signed (3 + a) i).
Definition three_sevenths := real (3 / 7).
Definition W (i j : nat) : C := Csum (seq 0 3) (fun a => Cmul (Cmul three_sevenths (z a i)) (z a j)).

Lemma z_rows a b : (a < 3)%nat -> (b < 3)%nat -> Csum joints (fun k => Cmul (z a k) (z b k)) = C0.
Proof.
  intros A B. apply C_eq.
  - rewrite re_Csum. cbn [re im z Cmul].
    rewrite (sum_ext _ _ (fun k => signed a k * signed b k + (-1) * (signed (3 + a) k * signed (3 + b) k))) by (intros; ring).
    rewrite sum_add, sum_scale, !signed_rows by lia.
    unfold delta. change (Nat.eqb (3 + a) (3 + b)) with (Nat.eqb a b). simpl. ring.
  - rewrite im_Csum. cbn [re im z Cmul].
    rewrite sum_add, !signed_rows by lia. unfold delta.
    destruct (Nat.eqb_spec a (3 + b)); [lia|]. destruct (Nat.eqb_spec (3 + a) b); [lia|]. simpl. ring.
Qed.

Lemma z_rows_conj a b : (a < 3)%nat -> (b < 3)%nat ->
  Csum joints (fun k => Cmul (z a k) (Cconj (z b k))) = real (14 / 3 * delta a b).
Proof.
  intros A B. apply C_eq.
  - rewrite re_Csum. cbn [re im z Cmul Cconj].
    rewrite (sum_ext _ _ (fun k => signed a k * signed b k + (signed (3 + a) k * signed (3 + b) k))) by (intros; ring).
    rewrite sum_add, !signed_rows by lia.
    unfold delta. change (Nat.eqb (3 + a) (3 + b)) with (Nat.eqb a b). simpl. field.
  - rewrite im_Csum. cbn [re im z Cmul Cconj].
    rewrite (sum_ext _ _ (fun k => (-1) * (signed a k * signed (3 + b) k) + signed (3 + a) k * signed b k)) by (intros; ring).
    rewrite sum_add, sum_scale, !signed_rows by lia. unfold delta.
    destruct (Nat.eqb_spec a (3 + b)); [lia|]. destruct (Nat.eqb_spec (3 + a) b); [lia|]. simpl. ring.
Qed.

Lemma lengths i : (i < 7)%nat -> sum (seq 0 3) (fun k => J k i * J k i) = 1.
Proof.
  intros I. pose proof (norms i I) as N. unfold gram in N. rewrite sum6, sum_add, (unit_axes _ _ rev i I) in N. lra.
Qed.

(** One product of W with W or its conjugate *)
Lemma W_times (f : C -> C) i j (f_add : forall x y, f (Cadd x y) = Cadd (f x) (f y))
  (f_mul : forall x y, f (Cmul x y) = Cmul (f x) (f y)) (f_c : f three_sevenths = three_sevenths) r
  (rows : forall a b, (a < 3)%nat -> (b < 3)%nat ->
    Csum joints (fun k => Cmul (z a k) (f (z b k))) = real (r * delta a b)) :
  Csum joints (fun k => Cmul (W i k) (f (W k j)))
  = Cmul (real (9 / 49 * r)) (Csum (seq 0 3) (fun a => Cmul (z a i) (f (z a j)))).
Proof.
  rewrite (Csum_ext joints _ (fun k => Cmul (W i k)
    (Csum (seq 0 3) (fun b => Cmul (Cmul three_sevenths (f (z b k))) (f (z b j)))))).
  2:{ intros k _. unfold W. rewrite !Csum3, !f_add, !f_mul, f_c. reflexivity. }
  unfold W. rewrite Csum_mul_swap, <- Csum_scale. apply Csum_ext; intros a A. apply in_seq in A.
  rewrite (Csum_ext (seq 0 3) _ (fun b => Cmul (Cmul (Cmul three_sevenths three_sevenths) (Cmul (z a i) (f (z b j)))) (real (r * delta a b)))).
  - rewrite Csum3. unfold delta. destruct a as [|[|[|]]]; try lia; apply C_eq; simpl; field.
  - intros b B. apply in_seq in B. rewrite <- rows by lia. rewrite <- Csum_scale.
    apply Csum_ext; intros. ring.
Qed.

Theorem W_solution : solution W.
Proof.
  split.
  - intros. apply Csum_ext; intros. ring.
  - intros i I. pose proof (lengths i I) as V. pose proof (unit_axes _ _ rev i I) as U.
    pose proof (orthogonal _ _ rev i I) as O. rewrite sum3 in U, V, O. simpl in U, V, O.
    unfold W. rewrite Csum3. unfold z, signed, three_sevenths. apply C_eq; simpl.
    + match goal with |- ?x = 0 => transitivity (3 / 7 * (sign i * sign i) *
        ((J 0 i * J 0 i + (J 1 i * J 1 i + J 2 i * J 2 i)) - (J 3 i * J 3 i + (J 4 i * J 4 i + J 5 i * J 5 i)))) end;
      [ring | rewrite U, V; ring].
    + match goal with |- ?x = 0 => transitivity (6 / 7 * (sign i * sign i) *
        (J 0 i * J 3 i + (J 1 i * J 4 i + J 2 i * J 5 i))) end; [field | rewrite O; ring].
  - intros i I. unfold W. rewrite Csum_swap. apply Csum_zero; intros a A. apply in_seq in A.
    rewrite Csum_scale. match goal with |- Cmul _ ?x = _ => assert (x = C0) as ->; [|ring] end.
    apply C_eq; [rewrite re_Csum | rewrite im_Csum]; cbn [re im z C0]; apply signed_null; lia.
  - intros i j I K. pose proof (W_times (fun x => x) i j) as E. cbv beta in E. rewrite (E) with (r := 0); auto.
    + apply C_eq; simpl; ring.
    + intros. rewrite z_rows by assumption. apply C_eq; simpl; ring.
  - intros i j I K. rewrite Csum_add.
    rewrite (W_times Cconj i j conj_add conj_mul) with (r := 14 / 3);
      [ | apply C_eq; simpl; ring | intros; apply z_rows_conj; assumption].
    rewrite (Csum_ext joints (fun k => Cmul (Cconj (W i k)) (W k j))
      (fun k => Cconj (Cmul (W i k) (Cconj (W k j))))) by (intros; rewrite conj_mul, conj_conj; reflexivity).
    rewrite Csum_conj.
    rewrite (W_times Cconj i j conj_add conj_mul) with (r := 14 / 3);
      [ | apply C_eq; simpl; ring | intros; apply z_rows_conj; assumption].
    pose proof (signed_columns i j I K) as G. rewrite sum6, sum3 in G. fold (delta i j).
    apply C_eq; rewrite Csum3; simpl; simpl in G.
    + match goal with |- ?x = _ => transitivity (12 / 7 *
        (signed 0 i * signed 0 j + signed 3 i * signed 3 j + (signed 1 i * signed 1 j + signed 4 i * signed 4 j + (signed 2 i * signed 2 j + signed 5 i * signed 5 j)))) end;
      [field | rewrite G; field].
    + field.
Qed.
End Reduction.
